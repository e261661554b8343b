"""Table of the problems from the literature."""

from collections.abc import Iterable

from rich.table import Table
from rich.text import Text

from harness.studies.precision.advice import format_power
from harness.studies.precision.table import empty_table

from .study import LiteratureRun


def literature_table(rows: Iterable[LiteratureRun]) -> Table:
    """Return the table of literature problems."""
    table = empty_table("problems from the literature: right-hand side calls and final error", "solver")
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
