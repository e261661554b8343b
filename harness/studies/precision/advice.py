"""Recommendations from a work-precision study: the fastest method for a given relative error."""

from collections.abc import Iterable
from itertools import groupby
from math import isnan

from .law_deviations import LawDeviation
from .study import FMI3_TOOLS, FMPY, FMU, Point, StudiedCase, Study

TARGET = 1e-6
TARGETS = (1e-3, TARGET, 1e-9)
NONE_REACHES = "no method of the FMU reaches an error of 1e-6"
QUICK_RUN_UNCLEAR = "no recommendation from a quick run; use `friction-fmus precision {}`"


def fastest_point(curve: Iterable[Point], target: float, beside_dry: bool = False) -> Point | None:
    """Return the fastest point with an error up to the target, or None."""
    sufficient = [point for point in curve if point.error(beside_dry) <= target]
    return min(sufficient, key=lambda point: point.seconds, default=None)


def rank_solvers(study: Study, case: StudiedCase, target: float, beside_dry: bool = False) -> list[Point]:
    """Return the fastest point of every solver that meets the target, fastest first; runs through fmpy are excluded."""
    curves = [study.curve(case, *solver) for solver in study.solvers(case) if solver[0] not in (FMPY, *FMI3_TOOLS)]
    points = [point for curve in curves if (point := fastest_point(curve, target, beside_dry))]
    return sorted(points, key=lambda point: point.seconds)


def recommend(study: Study, laws: Iterable[LawDeviation], min_ratio: float = 0.0) -> str:
    """Return a sentence with the recommendation for a model; run times must differ by the factor `min_ratio`."""
    best = [(case, rank_solvers(study, case, TARGET)) for case in study.cases if not case.is_chattering]
    no_method = QUICK_RUN_UNCLEAR.format(study.model) if min_ratio else NONE_REACHES
    parts = []
    for method, cases in groupby(best, key=lambda pair: best_method(pair[1], min_ratio)):
        parts.append(f"use {method}: " + join_words([describe_cost(*item) for item in cases]) if method else no_method)
    parts += [describe_shortcut(study, case) for case in study.cases if case.is_chattering]
    errors_by_law = {law.case: law.largest for law in laws}
    smooth = [
        f"{errors_by_law[case.name]:.2g}"
        for case in study.cases
        if case.name in errors_by_law and not case.is_chattering
    ]
    if smooth:
        parts.append(
            f"without integration error, these laws differ from dry friction by {join_words(smooth)} of the motion"
        )
    return f"{study.model}: " + "; ".join(parts) + "."


def best_method(ranks: list[Point], min_ratio: float) -> str:
    """Return the best method of the FMU; empty if another solver is faster or not clearly slower."""
    best = next((point for point in ranks if point.tool == FMU), None)
    if best is None or any(point.seconds < min_ratio * best.seconds for point in ranks if point is not best):
        return ""
    return best.method


def describe_cost(case: StudiedCase, ranks: list[Point]) -> str:
    """Describe the run time of the best method, and relative run times of the second best and of the best peer."""
    own_points = [point for point in ranks if point.tool == FMU]
    peers = [point for point in ranks if point.tool != FMU]
    first = own_points[0]
    tolerance_text = "" if isnan(first.rtol) else f" at rtol {format_power(first.rtol)}"
    text = f"error {format_power(first.largest)} in {1e3 * first.seconds:.2g} ms{tolerance_text} ({case.law}"
    others = [(point.method, point) for point in own_points[1:2]]
    others += [(f"{point.tool} {point.method}", point) for point in peers[:1]]
    ratios = [(name, point.seconds / first.seconds) for name, point in others]
    relative = [f"{name} {format_ratio(ratio)}" + ", not a method of the FMU" * (ratio < 1) for name, ratio in ratios]
    return text + (f"; relative run time at error {format_power(TARGET)}: {', '.join(relative)})" if relative else ")")


def describe_shortcut(study: Study, case: StudiedCase) -> str:
    """Describe the run time of a law that chatters, relative to the first law of the model."""
    solvers = [solver for solver in study.solvers(case) if solver[0] == FMU]
    points = [point for solver in solvers for point in study.curve(case, *solver)]
    best = rank_solvers(study, study.cases[0], TARGET)
    fastest = fastest_point(points, TARGET, beside_dry=True)
    if fastest and best:
        ratio = fastest.seconds / best[0].seconds
        return f"the law '{case.law}' takes {format_ratio(ratio)} times the run time at error {format_power(TARGET)}"
    nearest = min((point.beside_dry for point in points if point.beside_dry is not None), default=float("nan"))
    return f"the law '{case.law}' does not get below an error of {nearest:.1g} against stick and slip"


def format_ratio(value: float) -> str:
    """Format a ratio with two digits and without an exponent: 140."""
    return f"{float(f'{value:.2g}'):g}"


def format_power(value: float) -> str:
    """Format a power of ten: 1e-6."""
    return f"{value:.0e}".replace("e-0", "e-")


def join_words(words: list[str]) -> str:
    """Join words with commas and a final "and"."""
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))
