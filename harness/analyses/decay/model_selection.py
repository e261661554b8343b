"""Which of the laws: each fitted to the same samples, judged by BIC = n ln(squares/n) + p ln n (G. Schwarz, Annals of
Statistics 6 (1978)).

The laws are nested, and one more term can only take squares away: BIC cannot rise by more than ln n for it.  A law
that leaves more squares than one of its parts has stopped in a local minimum, and is fitted again from there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from .energy_balance import estimate_losses
from .fit_problem import FitProblem, FitResult
from .law import TERMS, ZETA, Terms, describe_law, sublaws

ROUNDS = 2
SAME = 1.0  # of n ln(squares)


@dataclass(frozen=True)
class FittedLaw:
    """A law with these `terms`: the values `p` of UNKNOWNS, in the problem's units, what they cost, and its BIC."""

    terms: Terms
    p: np.ndarray
    sum_of_squares: float
    bic: float

    @property
    def description(self) -> str:
        return describe_law(self.terms)


def select_reported_law(laws: tuple[FittedLaw, ...], full: FittedLaw, problem: FitProblem) -> FittedLaw:
    """The law whose values are told: the best one where the full one says the same within one standard error.

    Of nested fits no value moves by more standard errors than the root of what n ln(squares) changes by.
    """
    return full if more(problem, laws[0], full) > SAME else laws[0]


def more(problem: FitProblem, law: FittedLaw, other: FittedLaw) -> float:
    """By how much n ln(squares) of a law is more than that of another, as far as a fit is exact."""
    n, least = len(problem.t), len(problem.t) * problem.exact**2
    return n * float(np.log(max(law.sum_of_squares, least) / max(other.sum_of_squares, least)))


def fit_all_laws(
    problem: FitProblem, full: FitResult, terms: Terms, amplitudes: np.ndarray, report: Callable[[float], None]
) -> tuple[FittedLaw, ...]:
    """Every law of these terms, best first, from the fit of the full one and the amplitudes of turning points (n,)."""
    laws = sublaws(terms)
    fits = {terms: full}
    for done, law in enumerate(laws):
        report(done / len(laws))
        absent = [term for term in terms if term not in law and full[0][ZETA + TERMS.index(term)] > 0]
        if not absent:
            fits[law] = full
            continue
        without, start = full[0].copy(), full[0].copy()
        without[[ZETA + TERMS.index(term) for term in absent]] = 0.0
        start[ZETA:] = estimate_losses(amplitudes, law, problem.model.is_pendulum)
        fits[law] = problem.fit(min(without, start, key=lambda p: float(np.sum(problem.off(p, law)[0] ** 2))), law)
    for _ in range(ROUNDS):
        for less, more in permutations(laws, 2):
            if set(less) < set(more) and fits[more][1] > fits[less][1] * (1 + 1e-9) + 1e-30:
                fits[more] = min(problem.fit(fits[less][0], more), fits[less], key=lambda fit: fit[1])
    n = len(problem.t)

    def bic(law: Terms) -> float:
        return float(n * np.log(max(fits[law][1] / n, problem.exact**2)) + len(problem.unknowns(law)) * np.log(n))

    return tuple(sorted((FittedLaw(law, *fits[law], bic(law)) for law in laws), key=lambda law: law.bic))
