"""Table of the problems from the literature."""

from collections.abc import Sequence

from harness.results.quantity import format_power
from harness.results.summary import ResultColumn, ResultTable

from .study import LiteratureRun

COLUMNS = (
    ResultColumn("solver", "{0.solver}", is_text=True),
    ResultColumn("method", "{0.method}", is_text=True),
    ResultColumn("rtol", lambda run: format_power(run.rtol)),
    ResultColumn("calls", lambda run: "-" if run.evaluations is None else str(run.evaluations)),
    ResultColumn("error [SI]", lambda run: run.failure or f"{run.error:.1e}"),
)


def literature_table(runs: Sequence[LiteratureRun]) -> ResultTable:
    """Return the table of literature problems."""
    title = "problems from the literature: right-hand side calls and final error"
    return ResultTable(runs, COLUMNS, title, group=lambda run: (run.problem,))
