"""Points that do not fit a law: the generalized extreme Studentized deviate test.

B. Rosner, Technometrics 25 (1983) 165-172: points are removed one by one, each time the one with the largest residual;
all of them up to the last significant one are outliers, so that they do not hide each other.
"""

import numpy as np
from scipy import special

from .law_fit import MIN_FREEDOM, LawFit, fit_law
from .laws import Law

SIGNIFICANCE = 0.001  # of all points together
MAX_SHARE = 0.2  # of the points


def find_outliers(
    law: Law, v: np.ndarray, force: np.ndarray, known_bias: float | None, units: dict[str, str]
) -> tuple[LawFit, np.ndarray] | str:
    """Fit a law to the points that fit it.

    Returns
    -------
    (LawFit, numpy.ndarray) or str
        The fit, and the mask (n,) of the fitted points; or the reason why the law cannot be fitted.
    """
    fit = fit_law(law, v, force, known_bias, units, has_intervals=False)
    if isinstance(fit, str):
        return fit
    used, best = np.ones(len(v), bool), (fit, np.ones(len(v), bool))
    for _ in range(int(MAX_SHARE * len(v))):
        freedom = int(used.sum()) - len(fit.estimates)
        if freedom <= MIN_FREEDOM:
            break
        residuals = np.where(used, np.abs(force - fit.force(v)), 0.0)
        worst = int(np.argmax(residuals))
        remaining = used.copy()
        remaining[worst] = False
        reduced = fit_law(law, v[remaining], force[remaining], known_bias, units, has_intervals=False)
        if isinstance(reduced, str):
            break
        # the drop of the sum of squares by a point is an F-distributed multiple of the remaining variance
        variance = reduced.sum_of_squares / (freedom - 1)
        deviation = float(np.sqrt(max(fit.sum_of_squares - reduced.sum_of_squares, 0.0) / variance))
        fit, used = reduced, remaining
        if 2 * special.stdtr(freedom - 1, -deviation) * (used.sum() + 1) < SIGNIFICANCE:
            best = (fit, used)
    return best
