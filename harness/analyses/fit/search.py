"""Global search for the best values: continuation in time and differential evolution alternate.

Continuation in time compares a Sobol set on the first part of the record, where the squares have few minima, and
refines the best points on growing parts. Every other evolution also starts from the minima found so far, which it
combines. A search of one kind repeats its own errors, so the search ends when searches of both kinds have found the
same minimum. A minimum whose residuals are as small as the noise is also accepted after two more searches without a
lower one. Larger residuals are coloured noise or those of a wrong minimum, so more searches must find such a minimum.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import ceil, log2

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution
from scipy.stats import qmc

from .fit_problem import FitProblem, Selection

PART_SHARES, SURVIVORS, SOBOL_POINTS, SEARCH_SAMPLES = (0.15, 0.3, 0.55, 1.0), (40, 24, 12, 6), 2048, 250
EVOLUTION = {"maxiter": 150, "tol": 1e-2}
POPULATION = 10  # members of an evolution for each unknown, at least
COMBINATION_PERIOD = 4  # every so many searches, an evolution also starts from the minima found so far
SMALL_GAIN = 0.01  # relative reduction of the squares below which a minimum is not lower
PATIENCE = 40  # generations without a lower minimum, after which an evolution ends
NEAR_KNOWN = 1.2  # times the squares of the known minimum, at which an evolution has found it again
REFUSED_COST = 1e12
MAX_SEARCHES = 8
REQUIRED_HITS, REQUIRED_HITS_IF_UNEXPLAINED = 2, 4  # searches that must find the same minimum
WHITE_NOISE_MARGIN = 4.0  # standard errors of the squares of white noise: a minimum within them explains the records
REQUIRED_SEARCHES = 2  # searches that find nothing lower than such a minimum
REFINED_MINIMA = 4  # minima of a search that are refined
ROUGH = 1.5  # times the noise: larger residuals ask for more searches
DISTINCT = 0.02  # distance of coordinates from which minima are distinct

Minimum = tuple[float, np.ndarray]  # sum of squares, coordinates


@dataclass
class SearchResult:
    """Result of a search.

    Attributes
    ----------
    best : Minimum or None
        Lowest minimum; None if the FMU refuses all values that were tried.
    minima : list of Minimum
        All minima.
    n_searches, n_hits : int
        Number of searches, and of those that found the best minimum.
    is_agreed : bool
        Whether enough searches found it.
    log : list of str
        A line for each search.
    """

    best: Minimum | None = None
    minima: list[Minimum] = field(default_factory=list)
    n_searches: int = 0
    n_hits: int = 0
    is_agreed: bool = False
    log: list[str] = field(default_factory=list)


def search(
    problem: FitProblem, selection: Selection, starts: np.ndarray, report: Callable[[float], None]
) -> SearchResult:
    """Search until enough searches have found the same minimum of the squares of the selected samples.

    Parameters
    ----------
    starts : numpy.ndarray
        Coordinates (m, k) to try in addition.
    report : callable
        Receives the progress from 0 to 1.
    """
    result, first, unit = SearchResult(), 0, problem.scatter**2
    n = sum(len(index) * record.y.shape[1] for index, record in zip(selection, problem.records, strict=True))
    explained_squares = unit * (n + WHITE_NOISE_MARGIN * np.sqrt(2 * n))
    for number in range(1, MAX_SEARCHES + 1):
        report((number - 1) / MAX_SEARCHES)
        is_evolution = number % 2 == 0
        initial_minima = result.minima if number % COMBINATION_PERIOD == 0 else []
        is_known = not initial_minima and (
            (result.best and result.best[0] < explained_squares) or result.n_hits >= REQUIRED_HITS
        )
        known_minimum = result.best[1] if result.best and is_known else None
        candidates = (
            evolve(problem, number, known_minimum, initial_minima)
            if is_evolution
            else continue_in_time(problem, number, starts)
        )
        minima = [problem.minimize(z, selection, 20, 1e-6) for _, z in candidates[:REFINED_MINIMA]]
        result.minima += minima
        result.n_searches = number
        new = min(minima, key=lambda minimum: minimum[0], default=(np.inf, np.zeros(0)))
        kind = "differential evolution" if is_evolution else "continuation in time"
        result.log.append(f"search {number}, {kind}: sum of squares {new[0]:.6g}")
        if not np.isfinite(new[0]):
            continue
        if result.best and abs(new[0] - result.best[0]) < 0.5 * unit + 1e-3 * new[0]:
            result.n_hits += 1
        elif not result.best or new[0] < result.best[0]:
            result.n_hits, first = 1, number
        result.best = new if not result.best or new[0] < result.best[0] else result.best
        is_explained = result.best[0] < explained_squares
        is_confirmed = is_explained and number >= first + REQUIRED_SEARCHES
        if is_confirmed or result.n_hits >= (REQUIRED_HITS if is_explained else REQUIRED_HITS_IF_UNEXPLAINED):
            result.is_agreed = True
            break
    return result


def continue_in_time(problem: FitProblem, seed: int, starts: np.ndarray) -> list[Minimum]:
    """Return the minima that remain of a Sobol set and the `starts` on growing parts of the records."""
    parts, refused_cost = growing_parts(problem), REFUSED_COST * problem.scatter
    points = np.vstack([starts, sobol_set(problem, seed, SOBOL_POINTS)])
    costs = np.array([absolute_cost(problem, z, parts[0]) for z in points])
    order = [i for i in np.argsort(costs)[: SURVIVORS[0]] if costs[i] < refused_cost]
    order += [i for i in range(len(starts)) if i not in order and costs[i] < refused_cost]
    minima = [(float(costs[i]), points[i]) for i in order]
    for part, survivors in zip(parts, SURVIVORS, strict=True):
        minima = select_distinct([problem.minimize(z, part, 6, 1e-3) for _, z in minima], survivors)
    return minima


def sobol_set(problem: FitProblem, seed: int, count: int) -> np.ndarray:
    """Return coordinates (count, k) that fill the range of the search evenly; the count is a power of two."""
    return problem.low + (problem.high - problem.low) * qmc.Sobol(len(problem.unknowns), seed=seed).random(count)


def evolve(
    problem: FitProblem, seed: int, known_minimum: np.ndarray | None, initial_minima: list[Minimum]
) -> list[Minimum]:
    """Return the minima near the best members of a differential evolution of the absolute residuals.

    Least squares start from each new best member, which is near a minimum long before the population is.

    Parameters
    ----------
    known_minimum : numpy.ndarray or None
        Coordinates (k,) of a minimum that explains the records or that several searches found: the evolution ends when
        it finds one that is about as low.
    initial_minima : list of Minimum
        Minima to start from, in addition to a Sobol set.
    """
    part = growing_parts(problem)[-1]
    goal = 0.0 if known_minimum is None else NEAR_KNOWN * problem.minimize(known_minimum, part, 6, 1e-3)[0]
    minima: list[Minimum] = []
    best_member, last_improvement = np.array([]), 0
    population = sobol_set(problem, seed, 2 ** ceil(log2(POPULATION * len(problem.unknowns))))
    for i, (_, z) in enumerate(select_distinct(initial_minima, len(population) // 2)):
        population[i] = np.clip(z, problem.low, problem.high)

    def minimize_from_best(intermediate_result: OptimizeResult) -> bool:
        """Minimize from a new best member; return whether the evolution can end."""
        nonlocal best_member, last_improvement
        if not np.array_equal(intermediate_result.x, best_member):
            best_member = intermediate_result.x.copy()
            minimum = problem.minimize(best_member, part, 20, 1e-3)
            if not minima or minimum[0] < (1 - SMALL_GAIN) * min(squares for squares, _ in minima):
                last_improvement = intermediate_result.nit
            minima.append(minimum)
        is_idle = intermediate_result.nit - last_improvement >= PATIENCE
        return is_idle or min(squares for squares, _ in minima) < goal

    differential_evolution(
        lambda columns: np.array([absolute_cost(problem, z, part) for z in columns.T]),
        [*zip(problem.low, problem.high, strict=True)],
        seed=seed,
        init=population,
        polish=False,
        vectorized=True,
        updating="deferred",
        callback=minimize_from_best,
        **EVOLUTION,
    )
    return select_distinct(minima, SURVIVORS[-1])


def growing_parts(problem: FitProblem) -> list[Selection]:
    """Return selections of growing parts of the records."""
    points = max(SEARCH_SAMPLES // len(problem.records), 60)
    return [*zip(*(record.growing_parts(PART_SHARES, points) for record in problem.records), strict=True)]


def absolute_cost(problem: FitProblem, z: np.ndarray, selection: Selection) -> float:
    """Return the sum of absolute residuals, to which single events contribute less than to squares."""
    e = problem.residuals(z, selection)
    return REFUSED_COST * problem.scatter if e is None else float(np.abs(e).sum())


def select_distinct(minima: list[Minimum], max_count: int) -> list[Minimum]:
    """Return the lowest minima that differ from each other."""
    distinct_minima: list[Minimum] = []
    for squares, z in sorted(minima, key=lambda minimum: minimum[0]):
        is_new = all(np.abs(z - other).max() > DISTINCT for _, other in distinct_minima)
        if np.isfinite(squares) and len(distinct_minima) < max_count and is_new:
            distinct_minima.append((squares, z))
    return distinct_minima
