"""What to use, from the points of a work-precision study: the fastest that is right to a given share of the motion."""

from collections.abc import Iterable
from itertools import groupby
from math import isnan

from ...references.certified_reference import ReferenceCase
from .laws import Shortcut
from .study import FMPY, FMU, WAYS, Point, Study

TARGET = 1e-6
TARGETS = (1e-3, TARGET, 1e-9)
NOBODY = "no method of the FMU gets there"
UNTOLD = "a quick run does not tell what to use, `python -m harness precision {}` does"


def needed(curve: Iterable[Point], target: float, beside_dry: bool = False) -> Point | None:
    """The fastest point whose largest error is not above the target; None if there is none."""
    right = [p for p in curve if (p.beside_dry if beside_dry and p.beside_dry is not None else p.largest) <= target]
    return min(right, key=lambda point: point.seconds, default=None)


def ranking(study: Study, case: ReferenceCase, target: float) -> list[Point]:
    """The fastest point of every solver that meets the target, fastest first; FMUs without the ways through fmpy."""
    curves = [study.curve(case, *solver) for solver in study.solvers(case) if solver[0] not in (FMPY, *WAYS)]
    found = [point for curve in curves if (point := needed(curve, target))]
    return sorted(found, key=lambda point: point.seconds)


def advise(study: Study, laws: Iterable[Shortcut], clear: float = 0.0) -> str:
    """One sentence on what to use for a model; of what takes less than `clear` times as long as another, none."""
    best = [(case, ranking(study, case, TARGET)) for case in study.cases if not case.is_chattering]
    nothing = UNTOLD.format(study.cases[0].model) if clear else NOBODY
    parts = []
    for method, cases in groupby(best, key=lambda pair: choice(pair[1], clear)):
        parts.append(f"use {method}: " + series([price(*each) for each in cases]) if method else nothing)
    parts += [shortcut(study, case) for case in study.cases if case.is_chattering]
    off = {law.case: law.largest for law in laws}
    smooth = [f"{off[case.name]:.2g}" for case in study.cases if case.name in off and not case.is_chattering]
    if smooth:
        parts.append(f"however well integrated, these laws are {series(smooth)} of the motion away from dry friction")
    return f"{study.model}: " + "; ".join(parts) + "."


def choice(ranks: list[Point], clear: float) -> str:
    """The best method of the FMU; none where another solver, the FMU's own or a peer, comes near it or before it."""
    best = next((point for point in ranks if point.tool == FMU), None)
    if best is None or any(point.seconds < clear * best.seconds for point in ranks if point is not best):
        return ""
    return best.method


def price(case: ReferenceCase, ranks: list[Point]) -> str:
    """What the best method of the FMU costs, and how much longer the next best and the best peer take."""
    own = [point for point in ranks if point.tool == FMU]
    peers = [point for point in ranks if point.tool != FMU]
    first = own[0]
    where = "" if isnan(first.rtol) else f" at rtol {power(first.rtol)}"
    text = f"{power(first.largest)} of the motion takes {1e3 * first.seconds:.2g} ms{where} ({case.law}"
    others = [(point.method, point) for point in own[1:2]]
    others += [(f"{point.tool} {point.method}", point) for point in peers[:1]]
    ratios = [(name, point.seconds / first.seconds) for name, point in others]
    longer = [f"{name} {ratio:.2g} times" for name, ratio in ratios if ratio >= 1]
    less = [f"{name}, which is no method of the FMU, {ratio:.2g} of that" for name, ratio in ratios if ratio < 1]
    said = [f"{series(longer)} as long"] * bool(longer) + [f"only {each}" for each in less]
    return text + (f"; for {power(TARGET)} {series(said)})" if said else ")")


def shortcut(study: Study, case: ReferenceCase) -> str:
    """What a law that chatters costs, compared with the first law of the model."""
    solvers = [solver for solver in study.solvers(case) if solver[0] == FMU]
    points = [point for solver in solvers for point in study.curve(case, *solver)]
    best = ranking(study, study.cases[0], TARGET)
    found = needed(points, TARGET, beside_dry=True)
    if found and best:
        return f"the law '{case.law}' needs {found.seconds / best[0].seconds:.2g} times as long for {power(TARGET)}"
    nearest = min((point.beside_dry for point in points if point.beside_dry is not None), default=float("nan"))
    return f"the law '{case.law}' never comes nearer to true stick and slip than {nearest:.1g}"


def power(value: float) -> str:
    """A power of ten, as people write it."""
    return f"{value:.0e}".replace("e-0", "e-")


def series(words: list[str]) -> str:
    """Words in a row."""
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))
