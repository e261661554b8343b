"""Nonlinear least squares with nonnegative losses: the Levenberg-Marquardt method with active bounds.

A full step is tried first; the damping grows only while the sum of squares does.  A loss that would become negative is
held at zero in that step.

References
----------
K. Madsen, H. B. Nielsen, O. Tingleff, Methods for Non-Linear Least Squares Problems (2004), section 3.2
"""

from collections.abc import Callable

import numpy as np

from ...errors import HarnessError
from .law import AMPLITUDE, OMEGA, ZETA, R

Residual = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
MAX_DAMPING_RATIO = 0.9  # beyond, nothing oscillates
CONVERGED_GAIN = 1e-2  # reduction of the sum of squares at which a fit has converged, in variances of a sample
MAX_DAMPING = 1e4  # of the steps, at which a fit stops


class FitError(HarnessError):
    """No law fits the record.

    The text continues a sentence that starts with the name of the record; `advice` says what to do.
    """

    def __init__(self, text: str, advice: str = "select the free decay with --from and --until") -> None:
        super().__init__(text)
        self.advice = advice


def least_squares(
    residual: Residual, p: np.ndarray, unknowns: np.ndarray, max_steps: int = 30
) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
    """Minimise the sum of squared residuals over some of the UNKNOWNS.

    Parameters
    ----------
    residual : function of p that returns residuals (n,) and their Jacobian (n, k)
    p : starting values of all UNKNOWNS
    unknowns : (k,) indices of those to fit

    Returns
    -------
    p, sum of squares, residuals (n,), Jacobian (n, k)

    Raises
    ------
    FitError
        if the starting values give no motion
    """
    lowest = np.where(unknowns >= ZETA, 0.0, -np.inf)
    with np.errstate(all="ignore"):
        r, jacobian = residual(p)
        cost, damping = float(r @ r), 0.0
    if not (np.isfinite(cost) and np.isfinite(jacobian).all()):
        raise FitError("does not have the turning points of a free decay of one oscillator")
    for _ in range(max_steps):
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
            better = bool(np.isfinite(new_jacobian).all()) and new_cost <= cost * (1 + 1e-12)  # False for NaN
        converged = gain < CONVERGED_GAIN * cost / max(len(r) - len(unknowns), 1)
        if better:
            p, r, jacobian, cost = new, new_r, new_jacobian, new_cost
            damping = damping / 10 if damping > 1e-8 else 0.0
        else:
            damping = max(10 * damping, 1e-6)
            if damping > MAX_DAMPING:
                break
        if converged and (better or damping > 1):
            break
    return p, cost, r, jacobian


def column_norms(jacobian: np.ndarray) -> np.ndarray:
    """Return the norms of the columns, 1 for a column of zeros."""
    norms = np.linalg.norm(jacobian, axis=0)
    return np.where(norms == 0, 1.0, norms)


def bounded_step(matrix: np.ndarray, slope: np.ndarray, lowest: np.ndarray, damping: float) -> np.ndarray:
    """Return the damped step (k,) of the normal equations, with no component below `lowest` (k,)."""
    held = np.zeros(len(slope), bool)
    step = np.zeros(len(slope))
    while True:
        free = ~held
        step[held] = lowest[held]
        right = -slope[free] - matrix[np.ix_(free, held)] @ step[held]
        left = matrix[np.ix_(free, free)] + damping * np.eye(int(free.sum()))
        step[free] = np.linalg.lstsq(left, right, rcond=1e-15)[0]
        violated = free & (step < lowest)
        if not violated.any():
            return step
        held |= violated


def is_admissible(p: np.ndarray) -> bool:
    """Return whether the motion with the values p oscillates."""
    return bool(p[AMPLITUDE] > 0 and p[OMEGA] > 0 and p[ZETA] < MAX_DAMPING_RATIO and p[R] < p[AMPLITUDE])
