"""Tables of the work-precision studies, the laws and the anchors."""

from collections.abc import Iterable
from math import isnan

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from .advice import TARGETS, needed, power
from .anchors import AnchorRun
from .laws import Shortcut
from .study import Study


def work(study: Study) -> Table:
    """Run time in ms, and calls of right-hand side and Jacobian, that every solver needs for an error."""
    table = grid(f"{study.model}: ms and calls of the right-hand side that a largest error needs", "solver")
    for target in TARGETS:
        table.add_column(f"{power(target)}: ms", justify="right")
        table.add_column("calls", justify="right")
    for case in study.cases:
        table.add_section()
        table.add_row(Text(case.law, style="bold"))
        for tool, method in study.solvers(case):
            cells = []
            for target in TARGETS:
                point = needed(study.curve(case, tool, method), target)
                cells += [f"{1e3 * point.seconds:.3g}", f"{point.evaluations}"] if point else ["-", "-"]
            table.add_row(f"  {tool}: {method}", *cells)
    return table


def exchange(studies: Iterable[Study]) -> Table:
    """The largest error in model exchange at every relative tolerance."""
    table = grid("FMI 3.0 model exchange by fmpy's CVode: largest error at each rtol", "rtol")
    found: dict[float, dict[str, float]] = {}
    for study in studies:
        for rtol, errors in study.exchanged().items():
            found.setdefault(rtol, {}).update(errors)
    for case in next(iter(found.values()), {}):
        table.add_column(case.replace("-", "\n"), justify="right")
    for rtol, errors in found.items():
        table.add_row(power(rtol), *("-" if isnan(error) else power(error) for error in errors.values()))
    return table


def laws(found: Iterable[Shortcut]) -> Table:
    """The error of each law, integrated without error."""
    table = grid("model error: each law beside true stick and slip", "law")
    for name in ("final", "rms", "largest", "creep [m/s]", "period [s]", "a+/a-"):
        table.add_column(name, justify="right")
    for law in found:
        errors = ((law.final, ".2g"), (law.rms, ".2g"), (law.largest, ".2g"))
        figures = (*errors, (law.creep, ".2g"), (law.period, ".4f"), (law.asymmetry, ".3f"))
        table.add_row(law.case, *("" if value is None else f"{value:{how}}" for value, how in figures))
    return table


def anchors(rows: Iterable[AnchorRun]) -> Table:
    """The problems of other people."""
    table = grid("external anchors: calls of the right-hand side, and error at the end", "solver")
    table.add_column("method")
    for name in ("rtol", "calls", "error [SI]"):
        table.add_column(name, justify="right")
    last = ""
    for row in rows:
        if row.problem != last:
            table.add_section()
            table.add_row(Text(row.problem, style="bold"))
        calls = "-" if row.evaluations is None else f"{row.evaluations}"
        table.add_row(f"  {row.solver}", row.method, power(row.rtol), calls, row.failure or f"{row.error:.1e}")
        last = row.problem
    return table


def grid(title: str, first: str) -> Table:
    """An empty table with its first column, wide enough for the title."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    table.min_width = len(title)
    table.add_column(first, no_wrap=True)
    return table
