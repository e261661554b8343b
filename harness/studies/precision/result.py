"""The work-precision study of a model, with its files, its figure and what the command prints."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...results.files import column_heading, write_csv_rows
from ...results.result import Result
from ...results.summary import Summary, SummaryTable, make_table
from . import table
from .law_deviations import LawDeviation
from .method_choice import tabulate_choices
from .study import Point, Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNITS = {  # of columns; SI means m and m/s, or rad and rad/s
    **dict.fromkeys(("rtol", "final", "rms", "largest", "beside_dry", "asymmetry", "integration"), "1"),
    **dict.fromkeys(("seconds", "events", "period"), "s"),
    "atol": "SI",
    "creep": "m/s",
}
EXCHANGE_HEADING = "model exchange by fmpy's CVode: largest error at rtol [1]"
EXCHANGE_TABLE = "Model exchange with fmpy's CVode"


@dataclass(frozen=True, repr=False)
class PrecisionResult(Result):
    """The work-precision study of a model, as `load_result` reads it.

    Attributes
    ----------
    measured : Study
        All points of the model.
    deviations : tuple of LawDeviation
        Errors of its friction laws.
    advice : str
        Recommendation in a sentence.
    min_ratio : float
        Ratio of run times from which solvers are distinguished.
    """

    study, function = "precision", "load_result"

    measured: Study
    deviations: tuple[LawDeviation, ...]
    advice: str
    min_ratio: float = 0.0

    @property
    def title(self) -> str:
        return self.measured.model

    @property
    def headline(self) -> str:
        first, *_ = split_clauses(self.advice.removeprefix(f"{self.title}: "))
        return first

    def exchange_rows(self) -> tuple[list[str], list[list[float]]]:
        """Return headings and rows of the table of errors in model exchange; empty without any."""
        errors_by_rtol = self.measured.exchange_errors()
        cases = next(iter(errors_by_rtol.values()), {})
        rows = [[rtol, *errors.values()] for rtol, errors in errors_by_rtol.items()]
        return [EXCHANGE_HEADING, *(f"{case} [1]" for case in cases)], rows

    def summary(self) -> Summary:
        headings, rows = self.exchange_rows()
        exchange: tuple[SummaryTable, ...] = ()
        if rows:
            exchange = make_table(headings, ([f"{number:.4g}" for number in row] for row in rows), EXCHANGE_TABLE)
        choices, outcome = tabulate_choices(self.measured, self.min_ratio)
        return Summary(
            "precision",
            self.title,
            split_clauses(self.advice.removeprefix(f"{self.title}: ")),
            exchange + choices,
            f"{self.title}: run time and right-hand side evaluations over the largest error, by method",
            outcome,
        )

    def as_json(self) -> dict[str, Any]:
        return {"points": {self.title: self.measured.points}, "laws": self.deviations, "advice": [self.advice]}

    def blocks(self) -> list[Any]:
        tables = (
            table.work_precision_table(self.measured),
            table.exchange_table([self.measured]),
            table.deviation_table(self.deviations),
        )
        return [*(block for item in tables if item.rows for block in (item, "")), self.advice]

    def rows(self) -> tuple[list[Mapping[str, Any]], str]:
        return [asdict(point) for point in self.measured.points], "case"

    def write_tables(self, folder: Path) -> None:
        """Write points.csv, and model-exchange.csv and laws.csv if there are any."""
        write_table(folder / "points.csv", csv_headings(Point), map(astuple, self.measured.points))
        headings, rows = self.exchange_rows()
        if rows:
            write_table(folder / "model-exchange.csv", headings, rows)
        if self.deviations:
            write_table(folder / "laws.csv", csv_headings(LawDeviation), map(astuple, self.deviations))

    def draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self.measured, self.deviations, figure)

    def draw_panel(self, axes: "Axes") -> None:
        from .figure import draw_case

        draw_case(axes, self.measured, self.measured.cases[0])


def split_clauses(text: str) -> tuple[str, ...]:
    """Split a recommendation at its semicolons, except those in parentheses, into sentences.

    >>> split_clauses("use exact (1e-15; ode45 2 times); no more.")
    ('Use exact (1e-15; ode45 2 times).', 'No more.')
    """
    clauses = re.split(r"; (?![^()]*\))", text.rstrip("."))
    return tuple(f"{clause[:1].upper()}{clause[1:]}." for clause in clauses if clause)


def csv_headings(kind: type) -> list[str]:
    """Return the field names of a dataclass with their units."""
    return [column_heading(field.name, UNITS.get(field.name, "")) for field in fields(kind)]


def write_table(path: Path, headings: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV file; None and NaN are empty cells."""
    write_csv_rows(path, headings, ([None if value != value else value for value in row] for row in rows))
