"""A coupled scene that was run, with its files, its figure and what the command prints."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...results.files import column_heading, write_csv, write_csv_rows
from ...results.result import Result
from ...results.summary import Summary, make_table
from .convergence import Convergence

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class CoupledResult(Result, Convergence):
    """A coupled scene that was run at several communication steps, as `load_result` reads it.

    Its attributes are those of `Convergence`, and the `name` of the scene.
    """

    study, function = "coupled", "load_result"

    name: str = ""

    @property
    def title(self) -> str:
        return self.name

    @property
    def headline(self) -> str:
        errors = f"{min(self.errors):.3g} {self.unit}" if self.errors else "not known"
        return f"smallest error {errors.strip()}, order of convergence {self.order_text}"

    def summary(self) -> Summary:
        headings = "communication step [s]", column_heading("largest error", self.unit)
        rows = ((f"{step:g}", f"{error:.4g}") for step, error in zip(self.steps, self.errors, strict=False))
        text = f"Coupled scene {self.name}: positions with the {self.reference}, and error over the communication step"
        return Summary("coupled", self.name, tables=make_table(headings, rows), picture=text)

    def as_json(self) -> dict[str, Any]:
        engines = {
            name: {"largest error": error, "failure": reason} for name, (_, error, reason) in self.engines.items()
        }
        numbers = {"steps": self.steps, "errors": self.errors, "order": self.order}
        return numbers | {"engines": engines, "ignored": self.ignored}

    def blocks(self) -> list[Any]:
        return [
            f"communication step [s]   largest error{f' [{self.unit}]' if self.unit else ''}",
            *(f"{step:<24g} {error:.3e}" for step, error in zip(self.steps, self.errors, strict=False)),
            f"Order of convergence: {self.order_text}.",
            *(
                f"{name:<24} {reason or f'{error:.3e} at the smallest step'}"
                for name, (_, error, reason) in self.engines.items()
            ),
            *(
                f"The parameter {name} of the archive reaches no variable of an FMU: check its name."
                for name in self.ignored
            ),
        ]

    def rows(self) -> tuple[list[Mapping[str, Any]], str]:
        pairs = zip(self.steps, self.errors, strict=False)
        return [{"step": step, "largest error": error} for step, error in pairs], "step"

    def write_tables(self, folder: Path) -> None:
        """Write trajectory.csv, error.csv and engines.csv."""
        headings, reference_headings, final_headings = (
            [column_heading(name + suffix, size) for name, size in zip(self.names, self.units, strict=True)]
            for suffix in ("", " reference", " at the stop")
        )
        write_csv(
            folder / "trajectory.csv",
            ["t [s]", *headings, *reference_headings],
            [self.time, *self.x.T, *self.truth.T],
        )
        columns = [np.array(self.steps[: len(self.errors)]), np.array(self.errors)]
        write_csv(folder / "error.csv", ["communication step [s]", column_heading("largest error", self.unit)], columns)
        table = [
            [engine, *(end or [None] * len(self.names)), error, reason]
            for engine, (end, error, reason) in self.engines.items()
        ]
        table.append([self.reference, *self.truth[-1].tolist(), 0.0, ""])
        write_csv_rows(
            folder / "engines.csv",
            ["engine", *final_headings, column_heading("largest error", self.unit), "failure"],
            table,
        )

    def draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_error

        plot_error(axes, self)
