"""A comparison of two trajectories with its files, its figure and what the command prints."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from ...results.files import to_json
from ...results.provenance import describe_sources, prefix_parameters
from ...results.result import Result
from ...results.summary import Summary, make_terminal_table, read_cells
from .difference import Comparison

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = ("name", "unit", "largest", "at", "rms", "relative")  # of a variable in the JSON and in tables


@dataclass(frozen=True, repr=False)
class ComparisonResult(Result, Comparison):
    """The comparison of two trajectories, as `compare` returns it and `load_result` reads it.

    Its attributes are those of `Comparison`.
    """

    study, function = "compare", "compare"

    @property
    def title(self) -> str:
        return f"{self.one.name} and {self.two.name}"

    @property
    def headline(self) -> str:
        names = ", ".join(variable.name for variable in self.differences)
        return f"{names}; worst relative difference {self.worst:.3g}"

    def summary(self) -> Summary:
        sentences = filter(None, (self.events, self.one.accuracy, self.two.accuracy))
        picture = f"{self.title}, and their difference"
        return Summary("compare", self.title, tuple(sentences), read_cells(self.table()), picture)

    def table(self) -> Table:
        """Return the table of differences, with one row per variable."""
        result = make_terminal_table()
        result.add_column("variable")
        for heading in ("largest difference", "at t [s]", "rms", "relative to largest"):
            result.add_column(heading, justify="right", no_wrap=True)
        result.add_column("unit", no_wrap=True)
        for variable in self.differences:
            cells = (f"{variable.largest:.3e}", f"{variable.at:.6g}", f"{variable.rms:.3e}", f"{variable.relative:.2e}")
            result.add_row(variable.name, *cells, variable.unit)
        return result

    def blocks(self) -> list[Any]:
        grid = "those of the coarser side; the other one is interpolated" if self.interpolated else "common to both"
        nonfinite = [variable for variable in self.differences if isnan(variable.largest)]
        return [
            *([self.events, ""] if self.events else []),
            self.table(),
            "",
            *(f"{side.name}: {side.accuracy}" for side in (self.one, self.two) if side.accuracy),
            f"Compared at {len(self.time)} times ({grid}).",
            *(f"{variable.name} is not a finite number at t = {variable.at:g} s" for variable in nonfinite),
            *self.left_out,
        ]

    def rows(self) -> tuple[list[Mapping[str, Any]], str]:
        return [{name: getattr(variable, name) for name in COLUMNS} for variable in self.differences], "name"

    def as_json(self) -> dict[str, Any]:
        return {
            "one": {"name": self.one.name, "note": self.one.accuracy},
            "two": {"name": self.two.name, "note": self.two.accuracy},
            "times": len(self.time),
            "interpolated": self.interpolated,
            "variables": self.rows()[0],
            "left_out": list(self.left_out),
            **self.events_as_json(),
        }

    def events_as_json(self) -> dict[str, Any]:
        """Return the events for JSON output: time in s, new mode, and the contact if there are several.

        The shift is NaN if some are unmatched.
        """
        pairs = self.pairs
        if pairs is None:
            return {"events": self.events, "event_shift": None}
        return {
            "events": self.events,
            "event_shift": pairs.shift,
            "matched": {
                "one": pairs.list_rows(pairs.one),
                "two": pairs.list_rows(pairs.two),
                "shift": pairs.largest_shift,
            },
            "only_one": pairs.list_rows(pairs.unmatched[0]),
            "only_two": pairs.list_rows(pairs.unmatched[1]),
        }

    def origin(self) -> dict[str, Any]:
        sides = (self.one, self.two)
        return {
            "files": [side.source for side in sides if side.source],
            "parameters": prefix_parameters(
                {"one": self.one.effective_parameters, "two": self.two.effective_parameters}
            ),
            "source": describe_sources(*(str(side.source or side.name) for side in sides)),
        }

    def write_tables(self, folder: Path) -> None:
        (folder / "compare.json").write_text(to_json(self.as_json()) + "\n", encoding="utf-8")

    def draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_difference, select_variables

        for variable in select_variables(self)[:1]:
            plot_difference(axes, self, variable)
            axes.set_ylabel(variable.name)
            axes.set_xlabel("t [s]")
