"""Nonlinear least squares over some of the unknowns, with nonnegative losses, by scipy."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy import optimize

from ...errors import HarnessError
from . import thresholds
from .law import AMPLITUDE, OMEGA, T0, ZETA, R

Residual = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


class FitError(HarnessError):
    """No law fits the record.

    The text continues a sentence that starts with the name of the record; `advice` says what to do.
    """

    def __init__(self, text: str, advice: str = "select the free decay with --from and --until") -> None:
        super().__init__(text)
        self.advice = advice


def least_squares(
    residual: Residual, p: np.ndarray, unknowns: np.ndarray, max_steps: int = 30
) -> tuple[np.ndarray, float]:
    """Minimise the sum of squared residuals over some of the UNKNOWNS.

    Parameters
    ----------
    residual : function of p that returns residuals (n,) and their Jacobian (n, k)
    p : starting values of all UNKNOWNS
    unknowns : (k,) indices of those to fit

    Returns
    -------
    p, sum of squares

    Raises
    ------
    FitError
        if the starting values give no motion
    """
    start = p[unknowns]

    @lru_cache(maxsize=2)
    def evaluate(values: bytes) -> tuple[np.ndarray, np.ndarray, int]:
        """Return the problem at these values of the unknowns, compressed, and its number of residuals."""
        q = p.copy()
        q[unknowns] = np.frombuffer(values)
        r, jacobian = residual(q)
        is_motion = jacobian.any() and (is_admissible(q, p) or np.array_equal(q, p))
        residuals, slopes = compress(r if is_motion else np.full_like(r, np.nan), jacobian)
        return residuals, slopes, len(r)

    lowest = np.where(unknowns >= ZETA, 0.0, -np.inf)
    with np.errstate(all="ignore"):
        r, _, n = evaluate(start.tobytes())
    if not np.isfinite(r).all():
        raise FitError("does not have the turning points of a free decay of one oscillator")
    degrees_of_freedom = max(n - len(unknowns), 1)
    with np.errstate(all="ignore"):
        fit = optimize.least_squares(
            lambda values: evaluate(values.tobytes())[0],
            start,
            lambda values: evaluate(values.tobytes())[1],
            bounds=(lowest, np.inf),
            x_scale="jac",
            ftol=thresholds.CONVERGED_GAIN / degrees_of_freedom,
            xtol=thresholds.CONVERGED_CHANGE,
            gtol=None,
            max_nfev=max_steps + 1,
        )
    p = p.copy()
    p[unknowns] = fit.x
    # the method approaches a bound but does not reach it, and a law without a loss is recognised by its zero
    scale = column_norms(fit.jac)
    inverse = np.linalg.pinv((fit.jac / scale).T @ (fit.jac / scale))
    errors = np.sqrt(np.diag(inverse) * 2 * fit.cost / degrees_of_freedom) / scale
    is_zero = (lowest == 0) & (fit.x <= thresholds.ABSENT_LOSS * errors) & (fit.grad >= 0)
    if not is_zero.any():
        return p, 2 * float(fit.cost)
    p[unknowns[is_zero]] = 0.0

    def residual_of_others(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, jacobian = residual(q)
        return r, jacobian[:, ~is_zero]

    return least_squares(residual_of_others, p, unknowns[~is_zero], max_steps)


def compress(r: np.ndarray, jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals (k + 1,) and a Jacobian (k + 1, k) with the same sums of squares and products.

    They save scipy the singular values of long matrices.  If a value is not finite no residual is, and scipy refuses
    the step.
    """
    both = np.column_stack([jacobian, r])
    scale = column_norms(both)
    both /= scale
    products = both.T @ both
    if not np.isfinite(products).all():
        return np.full(len(scale), np.nan), np.full((len(scale), len(scale) - 1), np.nan)
    eigenvalues, axes = np.linalg.eigh(products)
    root = np.sqrt(np.maximum(eigenvalues, 0.0))[:, None] * axes.T * scale
    return root[:, -1], root[:, :-1]


def column_norms(jacobian: np.ndarray) -> np.ndarray:
    """Return the norms of the columns, 1 for a column of zeros."""
    norms = np.linalg.norm(jacobian, axis=0)
    return np.where(norms == 0, 1.0, norms)


def is_admissible(p: np.ndarray, start: np.ndarray) -> bool:
    """Return whether the motion with the values p oscillates, at about the time and the frequency of the start."""
    change = p[OMEGA] / start[OMEGA]
    return bool(
        1 / thresholds.MAX_FREQUENCY_CHANGE < change < thresholds.MAX_FREQUENCY_CHANGE
        and abs(p[T0] - start[T0]) * start[OMEGA] < thresholds.MAX_PHASE_CHANGE
        and p[ZETA] < thresholds.MAX_DAMPING_RATIO
        and max(p[R], 0.0) < p[AMPLITUDE]
    )
