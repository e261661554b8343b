"""Selection among the laws: each is fitted to the same samples and ranked by its Bayesian information criterion.

BIC = n ln(squares/n) + p ln n for p unknowns (G. Schwarz, Annals of Statistics 6 (1978)).  The laws are nested, so an
additional term can only reduce the sum of squares, and BIC can rise by no more than ln n.  A law with a larger sum of
squares than one of its special cases has stopped in a local minimum and is fitted again from that case.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from . import thresholds
from .decay_problem import DecayProblem, Minimum
from .law import TERMS, ZETA, Terms, describe_law, estimate_losses, sublaws


@dataclass(frozen=True)
class FittedLaw:
    """Fit of a law.

    Attributes
    ----------
    terms : tuple of str
        Terms of the law.
    p : numpy.ndarray
        Values (8,) of UNKNOWNS, in the units of the problem.
    sum_of_squares : float
        Sum of squares of the residuals.
    bic : float
        Bayesian information criterion.
    """

    terms: Terms
    p: np.ndarray
    sum_of_squares: float
    bic: float

    @property
    def description(self) -> str:
        return describe_law(self.terms)


def select_reported_law(laws: tuple[FittedLaw, ...], full: FittedLaw, problem: DecayProblem) -> FittedLaw:
    """Return the law whose values are reported: the best law if it agrees with the full law within a standard error.

    Between nested fits, no value moves by more standard errors than the root of the change of n ln(squares).
    """
    return full if deviance_difference(problem, laws[0], full) > thresholds.EQUAL_DEVIANCE else laws[0]


def deviance_difference(problem: DecayProblem, law: FittedLaw, other: FittedLaw) -> float:
    """Return n ln(squares) of a law minus that of another, with squares no smaller than the accuracy of the model."""
    n, floor = len(problem.t), len(problem.t) * problem.residual_floor**2
    return n * float(np.log(max(law.sum_of_squares, floor) / max(other.sum_of_squares, floor)))


def fit_all_laws(
    problem: DecayProblem, full: Minimum, terms: Terms, amplitudes: np.ndarray, report: Callable[[float], None]
) -> tuple[FittedLaw, ...]:
    """Fit every law with some of the terms and return them by rising BIC.

    Parameters
    ----------
    full : Minimum
        Fit of the law with all terms.
    amplitudes : numpy.ndarray
        Amplitudes (n,) at the turning points, for starting values.
    report : callable
        Receives the progress from 0 to 1.
    """
    laws = sublaws(terms)
    fits = {terms: full}
    for i, law in enumerate(laws):
        report(i / len(laws))
        other_terms = [term for term in terms if term not in law and full[0][ZETA + TERMS.index(term)] > 0]
        if not other_terms:
            fits[law] = full
            continue
        reduced_values, start = full[0].copy(), full[0].copy()
        reduced_values[[ZETA + TERMS.index(term) for term in other_terms]] = 0.0
        start[ZETA:] = estimate_losses(amplitudes, law, problem.model.is_pendulum)
        best = min(reduced_values, start, key=lambda p: float(np.sum(problem.residuals(p, law)[0] ** 2)))
        fits[law] = problem.fit(best, law)
    for _ in range(thresholds.MAX_REFITS):
        for sublaw, law in permutations(laws, 2):
            if set(sublaw) < set(law) and fits[law][1] > fits[sublaw][1] * (1 + 1e-9) + 1e-30:
                fits[law] = min(problem.fit(fits[sublaw][0], law), fits[sublaw], key=lambda fit: fit[1])
    n = len(problem.t)

    def bic(law: Terms) -> float:
        floor = problem.residual_floor**2
        return float(n * np.log(max(fits[law][1] / n, floor)) + len(problem.unknowns(law)) * np.log(n))

    return tuple(sorted((FittedLaw(law, *fits[law], bic(law)) for law in laws), key=lambda law: law.bic))
