"""Outcomes of stiff and extreme cases, with their files, their figure and what the command prints."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import check_names
from ...results.files import write_csv_rows
from ...results.result import Result
from ...results.summary import Summary
from . import table
from .outcomes import CaseOutcome, StabilityRegion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class StabilityResult(Result):
    """Outcomes of stiff and extreme cases, as `load_result` reads them.

    Attributes
    ----------
    outcomes : tuple of CaseOutcome
        Outcome of each case.
    regions : tuple of StabilityRegion
        Number of steps of each method over the stiffness.
    """

    study, function = "stability", "load_result"

    outcomes: tuple[CaseOutcome, ...]
    regions: tuple[StabilityRegion, ...]

    @property
    def title(self) -> str:
        return "Outcomes"

    @property
    def headline(self) -> str:
        return f"{sum(row.has_passed for row in self.outcomes)} of {len(self.outcomes)} ended as expected"

    def summary(self) -> Summary:
        return table.summarize_outcomes(list(self.outcomes))

    def as_json(self) -> Any:
        return [{"scene": row.case.label, "passed": row.has_passed, "ended": row.ended} for row in self.outcomes]

    def __getitem__(self, name: str) -> Any:
        """Return how a case ended by its label, as in the JSON."""
        cases = {case["scene"]: case for case in self.as_json()}
        check_names("case", [name], cases)
        return cases[name]

    def blocks(self) -> list[Any]:
        rows = list(self.outcomes)
        tables = table.error_table(rows), table.refusal_table(rows)
        return [tables[0], "", tables[1], "", table.summary(rows, self.regions)]

    def describe_failures(self) -> Iterator[str]:
        """Yield a sentence on each case that did not end as expected."""
        return (f"{row.case.label}: {row.text}" for row in self.outcomes if not row.has_passed)

    def rows(self) -> tuple[list[Mapping[str, Any]], str]:
        return [
            {
                "case": row.case.label,
                "passed": row.has_passed,
                "ended": row.ended,
                "error": row.error,
                "steps": row.steps,
            }
            for row in self.outcomes
        ], "case"

    def write_tables(self, folder: Path) -> None:
        """Write stability.csv with one line per case."""
        headings = ["model", "scene", "method", "expected", "ended", "error [1]", "energy rise [1]"]
        headings += ["events", "steps", "rejected", "evaluations", "run time [s]", "sentence"]
        write_csv_rows(folder / "stability.csv", headings, map(table_line, self.outcomes))

    def draw(self, figure: "Figure") -> None:
        from .figure import draw

        if self.regions:
            draw(self.regions, figure)

    def draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_steps

        plot_steps(axes, self.regions)


def table_line(row: CaseOutcome) -> list[Any]:
    """Return the cells of one case in stability.csv."""
    case, motion = row.case, row.motion
    counts: tuple[Any, ...] = ("", "", "", "", math.nan)
    if motion and motion.statistics:
        statistics = motion.statistics
        counts = (statistics.events, statistics.steps, statistics.rejected, statistics.evaluations, statistics.seconds)
    return [case.name, case.title, case.method, row.expected, row.ended, row.error, row.energy_rise, *counts, row.text]
