"""What to use, from the points of a work-precision study: the fastest that is right to a given share of the motion."""

from collections.abc import Iterable
from itertools import groupby
from math import isnan

from ...references.certified_reference import ReferenceCase
from .law_deviations import LawDeviation
from .study import FMI3_INTERFACES, FMPY, FMU, Point, Study

TARGET = 1e-6
TARGETS = (1e-3, TARGET, 1e-9)
NONE_REACHES = "no method of the FMU gets there"
QUICK_RUN_UNCLEAR = "a quick run does not tell what to use, `python -m harness precision {}` does"


def fastest_point(curve: Iterable[Point], target: float, beside_dry: bool = False) -> Point | None:
    """The fastest point whose largest error is not above the target; None if there is none."""
    right = [p for p in curve if (p.beside_dry if beside_dry and p.beside_dry is not None else p.largest) <= target]
    return min(right, key=lambda point: point.seconds, default=None)


def rank_solvers(study: Study, case: ReferenceCase, target: float) -> list[Point]:
    """The fastest point of every solver that meets the target, fastest first; FMUs without the ways through fmpy."""
    curves = [study.curve(case, *solver) for solver in study.solvers(case) if solver[0] not in (FMPY, *FMI3_INTERFACES)]
    found = [point for curve in curves if (point := fastest_point(curve, target))]
    return sorted(found, key=lambda point: point.seconds)


def recommend(study: Study, laws: Iterable[LawDeviation], clear: float = 0.0) -> str:
    """One sentence on what to use for a model; of what takes less than `clear` times as long as another, none."""
    best = [(case, rank_solvers(study, case, TARGET)) for case in study.cases if not case.is_chattering]
    nothing = QUICK_RUN_UNCLEAR.format(study.cases[0].model) if clear else NONE_REACHES
    parts = []
    for method, cases in groupby(best, key=lambda pair: best_method(pair[1], clear)):
        parts.append(f"use {method}: " + join_words([describe_cost(*each) for each in cases]) if method else nothing)
    parts += [describe_shortcut(study, case) for case in study.cases if case.is_chattering]
    off = {law.case: law.largest for law in laws}
    smooth = [f"{off[case.name]:.2g}" for case in study.cases if case.name in off and not case.is_chattering]
    if smooth:
        parts.append(
            f"however well integrated, these laws are {join_words(smooth)} of the motion away from dry friction"
        )
    return f"{study.model}: " + "; ".join(parts) + "."


def best_method(ranks: list[Point], clear: float) -> str:
    """The best method of the FMU; none where another solver, the FMU's own or a peer, comes near it or before it."""
    best = next((point for point in ranks if point.tool == FMU), None)
    if best is None or any(point.seconds < clear * best.seconds for point in ranks if point is not best):
        return ""
    return best.method


def describe_cost(case: ReferenceCase, ranks: list[Point]) -> str:
    """What the best method of the FMU costs, and how much longer the next best and the best peer take."""
    own = [point for point in ranks if point.tool == FMU]
    peers = [point for point in ranks if point.tool != FMU]
    first = own[0]
    where = "" if isnan(first.rtol) else f" at rtol {format_power(first.rtol)}"
    text = f"{format_power(first.largest)} of the motion takes {1e3 * first.seconds:.2g} ms{where} ({case.law}"
    others = [(point.method, point) for point in own[1:2]]
    others += [(f"{point.tool} {point.method}", point) for point in peers[:1]]
    ratios = [(name, point.seconds / first.seconds) for name, point in others]
    longer = [f"{name} {ratio:.2g} times" for name, ratio in ratios if ratio >= 1]
    less = [f"{name}, which is no method of the FMU, {ratio:.2g} of that" for name, ratio in ratios if ratio < 1]
    said = [f"{join_words(longer)} as long"] * bool(longer) + [f"only {each}" for each in less]
    return text + (f"; for {format_power(TARGET)} {join_words(said)})" if said else ")")


def describe_shortcut(study: Study, case: ReferenceCase) -> str:
    """What a law that chatters costs, compared with the first law of the model."""
    solvers = [solver for solver in study.solvers(case) if solver[0] == FMU]
    points = [point for solver in solvers for point in study.curve(case, *solver)]
    best = rank_solvers(study, study.cases[0], TARGET)
    found = fastest_point(points, TARGET, beside_dry=True)
    if found and best:
        return (
            f"the law '{case.law}' needs {found.seconds / best[0].seconds:.2g} times as long for {format_power(TARGET)}"
        )
    nearest = min((point.beside_dry for point in points if point.beside_dry is not None), default=float("nan"))
    return f"the law '{case.law}' never comes nearer to true stick and slip than {nearest:.1g}"


def format_power(value: float) -> str:
    """A power of ten, as people write it."""
    return f"{value:.0e}".replace("e-0", "e-")


def join_words(words: list[str]) -> str:
    """Words in a row."""
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))
