"""Least squares with losses that are at least zero: Levenberg and Marquardt's method with active bounds.

A full step is tried first; damping grows only while the squares do (K. Madsen, H. B. Nielsen, O. Tingleff, Methods for
Non-Linear Least Squares Problems (2004), section 3.2).  A loss that would become negative is held at zero in that step.
"""

from collections.abc import Callable

import numpy as np

from ...errors import HarnessError
from .law import AMPLITUDE, OMEGA, ZETA, R

Residual = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
STEEPEST = 0.9  # damping ratio: beyond, nothing swings
NEGLIGIBLE = 1e-2  # gain in squares, in variances of a sample, at which a fit has arrived
STUCK = 1e4  # damping at which no step is left to try


class FitError(HarnessError):
    """No law fits, and what to try; the text goes on after the name of the record."""

    def __init__(self, text: str, advice: str = "cut out what is one with --from and --until") -> None:
        super().__init__(text)
        self.advice = advice


def least_squares(
    residual: Residual, p: np.ndarray, unknowns: np.ndarray, steps: int = 30
) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
    """The values p of UNKNOWNS at which residual(p) is least over those in `unknowns`; with the sum of squares, the
    residuals (n,) and their Jacobian (n, unknowns).  Unfit where there is no motion to begin with."""
    lowest = np.where(unknowns >= ZETA, 0.0, -np.inf)
    with np.errstate(all="ignore"):
        r, jacobian = residual(p)
        cost, damping = float(r @ r), 0.0
    if not (np.isfinite(cost) and np.isfinite(jacobian).all()):
        raise FitError("does not turn where a free decay of one oscillator would")
    for _ in range(steps):
        scale = column_norms(jacobian)
        matrix, slope = (jacobian / scale).T @ (jacobian / scale), (jacobian / scale).T @ r
        step = bounded_step(matrix, slope, (lowest - p[unknowns]) * scale, damping)
        gain = -float(2 * slope @ step + step @ matrix @ step)
        new = p.copy()
        new[unknowns] = np.maximum(p[unknowns] + step / scale, lowest)
        better = is_admissible(new)
        if better:
            with np.errstate(all="ignore"):
                new_r, new_jacobian = residual(new)
                new_cost = float(new_r @ new_r)
            better = np.isfinite(new_cost) and bool(np.isfinite(new_jacobian).all()) and new_cost <= cost * (1 + 1e-12)
        arrived = gain < NEGLIGIBLE * cost / max(len(r) - len(unknowns), 1)
        if better:
            p, r, jacobian, cost = new, new_r, new_jacobian, new_cost
            damping = damping / 10 if damping > 1e-8 else 0.0
        else:
            damping = max(10 * damping, 1e-6)
            if damping > STUCK:
                break
        if arrived and (better or damping > 1):
            break
    return p, cost, r, jacobian


def column_norms(jacobian: np.ndarray) -> np.ndarray:
    """The lengths of the columns, 1 for one of zeros."""
    lengths = np.linalg.norm(jacobian, axis=0)
    return np.where(lengths == 0, 1.0, lengths)


def bounded_step(matrix: np.ndarray, slope: np.ndarray, lowest: np.ndarray, damping: float) -> np.ndarray:
    """The damped step of the normal equations that goes nowhere below `lowest`."""
    held = np.zeros(len(slope), bool)
    step = np.zeros(len(slope))
    while True:
        free = ~held
        step[held] = lowest[held]
        right = -slope[free] - matrix[np.ix_(free, held)] @ step[held]
        left = matrix[np.ix_(free, free)] + damping * np.eye(int(free.sum()))
        step[free] = np.linalg.lstsq(left, right, rcond=1e-15)[0]
        over = free & (step < lowest)
        if not over.any():
            return step
        held |= over


def is_admissible(p: np.ndarray) -> bool:
    """Whether these values are of a motion that swings."""
    return bool(p[AMPLITUDE] > 0 and p[OMEGA] > 0 and p[ZETA] < STEEPEST and p[R] < p[AMPLITUDE])
