"""Points that do not fit a law: the generalized extreme Studentized deviate test.

B. Rosner, Technometrics 25 (1983) 165-172: points are removed one by one, each time the one with the largest residual;
all of them up to the last significant one are outliers, so that they do not hide each other.
"""

from collections.abc import Sequence

import numpy as np
from scipy import special

from .law_fit import MIN_FREEDOM, Law, LawFit, fit_law, linearise
from .points import CurvePoints, Effect

SIGNIFICANCE = 0.001  # of all points together
MAX_SHARE = 0.2  # of the points
SMALL = 2.5  # standard deviations: a largest residual below hides no further outlier
STEP, MAX_FITS = 5.0, 10  # ratio of the residuals that are left out after one fit, and number of fits
MIN_WEIGHT = 1e-6  # of a point that the fit does not follow


def find_outliers(
    law: Law, points: CurvePoints, known_bias: float | None, effects: Sequence[Effect]
) -> tuple[LawFit, np.ndarray] | str:
    """Fit a law to the points that fit it.

    Returns
    -------
    (LawFit, numpy.ndarray) or str
        The fit, and the mask (n,) of the fitted points; or the reason why the law cannot be fitted.
    """
    is_used, best = np.ones(len(points.v), bool), None
    for _ in range(MAX_FITS):
        fit = fit_law(law, points.select(is_used), known_bias, effects, has_intervals=False)
        if isinstance(fit, str):
            return fit
        residuals, jacobian, _ = linearise(fit, points)
        best, is_used = (
            (fit, is_used),
            find_fitting(residuals, jacobian, float(np.abs(residuals[is_used]).max()) / STEP, points.precision),
        )
        if (is_used == best[1]).all():
            break
    return best or "the points do not suffice"


def find_fitting(e: np.ndarray, jacobian: np.ndarray, smallest: float, precision: float) -> np.ndarray:
    """Return the mask (n,) of the values e (n,) without the outliers of the linear model with a jacobian (n, p).

    Residuals below `smallest` are left in: a fit without the larger ones shows whether they are outliers.
    """
    n, p = jacobian.shape
    is_used = best = np.ones(n, bool)
    scale = np.linalg.norm(jacobian, axis=0) + 1e-300
    for _ in range(int(MAX_SHARE * n)):
        freedom = int(is_used.sum()) - p
        if freedom <= MIN_FREEDOM:
            break
        q, _ = np.linalg.qr(jacobian[is_used] / scale)
        residuals = e[is_used] - q @ (q.T @ e[is_used])
        drops = residuals**2 / np.maximum(1 - (q**2).sum(axis=1), MIN_WEIGHT)
        worst = int(np.argmax(drops))
        # the drop of the sum of squares by a point is an F-distributed multiple of the remaining variance
        variance = max(float(residuals @ residuals - drops[worst]) / (freedom - 1), precision**2)
        is_used = is_used.copy()
        is_used[np.flatnonzero(is_used)[worst]] = False
        deviation = float(np.sqrt(drops[worst] / (variance + 1e-300)))
        if 2 * special.stdtr(freedom - 1, -deviation) * (is_used.sum() + 1) < SIGNIFICANCE:
            best = is_used
        if deviation < SMALL or drops[worst] < smallest**2:
            break
    return best
