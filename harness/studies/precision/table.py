"""Tables of work-precision studies and law deviations."""

from collections.abc import Iterable
from math import isnan

from rich.table import Table
from rich.text import Text

from ...results.summary import make_terminal_table
from .advice import TARGETS, fastest_point, format_power
from .law_deviations import LawDeviation
from .study import Study


def work_precision_table(study: Study) -> Table:
    """Return the table of run time in ms and evaluations that every solver needs for a given error.

    Solvers that did not run are left out.
    """
    table = empty_table(f"{study.model}: run time and right-hand side calls for a given largest error", "solver")
    for target in TARGETS:
        table.add_column(f"{format_power(target)}: ms", justify="right")
        table.add_column("calls", justify="right")
    for case in study.cases:
        rows = [(tool, method) for tool, method in study.solvers(case) if study.curve(case, tool, method)]
        if rows:
            table.add_section()
            table.add_row(Text(case.law, style="bold"))
        for tool, method in rows:
            cells = []
            for target in TARGETS:
                point = fastest_point(study.curve(case, tool, method), target)
                cells += [f"{1e3 * point.seconds:.3g}", f"{point.evaluations}"] if point else ["-", "-"]
            table.add_row(f"  {tool}: {method}", *cells)
    return table


def exchange_table(studies: Iterable[Study]) -> Table:
    """Return the table of largest errors in model exchange by relative tolerance."""
    table = empty_table("FMI 3.0 model exchange with fmpy's CVode: largest error by rtol", "rtol")
    errors_by_rtol: dict[float, dict[str, float]] = {}
    for study in studies:
        for rtol, errors in study.exchange_errors().items():
            errors_by_rtol.setdefault(rtol, {}).update(errors)
    for case in next(iter(errors_by_rtol.values()), {}):
        table.add_column(case.replace("-", "\n"), justify="right")
    for rtol, errors in errors_by_rtol.items():
        table.add_row(format_power(rtol), *("-" if isnan(error) else format_power(error) for error in errors.values()))
    return table


def deviation_table(deviations: Iterable[LawDeviation]) -> Table:
    """Return the table of law deviations."""
    table = empty_table("laws: model error against true stick and slip; within: integration error", "law")
    for name in ("rms", "largest", "within", "creep [m/s]", "period [s]", "a+/a-"):
        table.add_column(name, justify="right")
    for law in deviations:
        errors = ((law.rms, ".2g"), (law.largest, ".2g"), (law.integration, ".0e"))
        figures = (*errors, (law.creep, ".2g"), (law.period, ".4f"), (law.asymmetry, ".3f"))
        table.add_row(
            law.case, *("" if value is None else f"{value:{number_format}}" for value, number_format in figures)
        )
    return table


def empty_table(title: str, first: str) -> Table:
    """Return an empty table with its first column, as wide as the title."""
    table = make_terminal_table(title)
    table.min_width = len(title)
    table.add_column(first, no_wrap=True)
    return table
