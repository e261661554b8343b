"""Tables of the work-precision studies, the laws and the anchors."""

from collections.abc import Iterable
from math import isnan

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from .advice import TARGETS, fastest_point, format_power
from .law_deviations import LawDeviation
from .literature_problems import LiteratureRun
from .study import Study


def work_precision_table(study: Study) -> Table:
    """Run time in ms, and calls of right-hand side and Jacobian, that every solver needs for an error."""
    table = empty_table(f"{study.model}: ms and calls of the right-hand side that a largest error needs", "solver")
    for target in TARGETS:
        table.add_column(f"{format_power(target)}: ms", justify="right")
        table.add_column("calls", justify="right")
    for case in study.cases:
        table.add_section()
        table.add_row(Text(case.law, style="bold"))
        for tool, method in study.solvers(case):
            cells = []
            for target in TARGETS:
                point = fastest_point(study.curve(case, tool, method), target)
                cells += [f"{1e3 * point.seconds:.3g}", f"{point.evaluations}"] if point else ["-", "-"]
            table.add_row(f"  {tool}: {method}", *cells)
    return table


def exchange_table(studies: Iterable[Study]) -> Table:
    """The largest error in model exchange at every relative tolerance."""
    table = empty_table("FMI 3.0 model exchange by fmpy's CVode: largest error at each rtol", "rtol")
    found: dict[float, dict[str, float]] = {}
    for study in studies:
        for rtol, errors in study.exchange_errors().items():
            found.setdefault(rtol, {}).update(errors)
    for case in next(iter(found.values()), {}):
        table.add_column(case.replace("-", "\n"), justify="right")
    for rtol, errors in found.items():
        table.add_row(format_power(rtol), *("-" if isnan(error) else format_power(error) for error in errors.values()))
    return table


def deviation_table(found: Iterable[LawDeviation]) -> Table:
    """The error of each law, integrated without error."""
    table = empty_table("model error: each law beside true stick and slip", "law")
    for name in ("final", "rms", "largest", "creep [m/s]", "period [s]", "a+/a-"):
        table.add_column(name, justify="right")
    for law in found:
        errors = ((law.final, ".2g"), (law.rms, ".2g"), (law.largest, ".2g"))
        figures = (*errors, (law.creep, ".2g"), (law.period, ".4f"), (law.asymmetry, ".3f"))
        table.add_row(law.case, *("" if value is None else f"{value:{how}}" for value, how in figures))
    return table


def literature_table(rows: Iterable[LiteratureRun]) -> Table:
    """The problems of other people."""
    table = empty_table("external anchors: calls of the right-hand side, and error at the end", "solver")
    table.add_column("method")
    for name in ("rtol", "calls", "error [SI]"):
        table.add_column(name, justify="right")
    last = ""
    for row in rows:
        if row.problem != last:
            table.add_section()
            table.add_row(Text(row.problem, style="bold"))
        calls = "-" if row.evaluations is None else f"{row.evaluations}"
        table.add_row(f"  {row.solver}", row.method, format_power(row.rtol), calls, row.failure or f"{row.error:.1e}")
        last = row.problem
    return table


def empty_table(title: str, first: str) -> Table:
    """An empty table with its first column, wide enough for the title."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    table.min_width = len(title)
    table.add_column(first, no_wrap=True)
    return table
