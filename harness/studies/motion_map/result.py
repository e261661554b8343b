"""What motions end in over one or two parameters, with its files, its figure and what the command prints."""

from collections import Counter
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...results.files import column_heading
from ...results.provenance import describe_sources
from ...results.result import Result
from ...results.summary import ResultColumn, ResultTable
from ...scenes.run_spec import RunSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_ROWS = 20  # of the table of edges


@dataclass(frozen=True)
class Edge:
    """A point on the edge between two regions.

    Attributes
    ----------
    point : tuple of float
        Values of the parameters.
    below, above : str
        What motions end in below and above it, along the line of the grid.
    """

    point: tuple[float, ...]
    below: str
    above: str

    @property
    def name(self) -> str:
        """Return what the edge separates, in the same order on lines of either direction."""
        return " | ".join(sorted((self.below, self.above)))


@dataclass(frozen=True, repr=False)
class MapResult(Result):
    """What motions end in at the points of a grid, and the edges between its regions.

    Attributes
    ----------
    spec : RunSpec
        FMU and values.
    units : dict
        Unit of each varied parameter.
    axes : tuple of numpy.ndarray
        Values (n,) of each parameter.
    labels : tuple of str
        What motions end in at each point of the grid; the first parameter varies fastest.
    edges : tuple of Edge
        Edges along the lines of the grid.
    n_gaps : int
        Number of edges after which another region follows than the next edge, or the end of the line, has.
    n_runs : int
        Number of runs of the FMU.
    failures : tuple of str
        Points of the runs that failed, with their messages.
    settings : dict
        Values of the other parameters.
    options : dict
        Period, section, measure and levels, as far as they are given.
    """

    study, _function = "map", "map_motions"

    spec: RunSpec
    units: dict[str, str]
    axes: tuple[np.ndarray, ...]
    labels: tuple[str, ...]
    edges: tuple[Edge, ...]
    n_gaps: int
    n_runs: int
    failures: tuple[str, ...]
    settings: dict[str, Any]
    options: dict[str, Any]

    @property
    def title(self) -> str:
        return f"{self.spec.model} over {', '.join(self.units)}"

    @property
    def _headline(self) -> str:
        return f"{len(self.labels)} points, {len(self.edges)} edges"

    @property
    def _caption(self) -> str:
        return f"{self.title}: regions of what motions end in"

    def _rows(self, edges: tuple[Edge, ...]) -> list[dict[str, Any]]:
        return [
            dict(zip(self.units, edge.point, strict=True)) | {"below": edge.below, "above": edge.above}
            for edge in edges
        ]

    def _columns(self) -> tuple[ResultColumn, ...]:
        values = [
            ResultColumn(column_heading(name, unit), partial(format_value, name)) for name, unit in self.units.items()
        ]
        return (
            *values,
            ResultColumn("below", "{0[below]}", is_text=True),
            ResultColumn("above", "{0[above]}", is_text=True),
        )

    def _tabulate(self) -> tuple[ResultTable, ...]:
        return (ResultTable(self._rows(self.edges[:MAX_ROWS]), self._columns(), "Edges"),)

    def _data_table(self) -> ResultTable:
        points = product(*self.axes[::-1])
        rows = [dict(zip([*self.units][::-1], map(float, point), strict=True)) for point in points]
        return ResultTable(
            [
                {name: row[name] for name in self.units} | {"ends_in": label}
                for row, label in zip(rows, self.labels, strict=True)
            ],
            self._columns(),
        )

    def sentences(self) -> list[str]:
        """Return the sizes of the regions, and the number of runs."""
        counts = ", ".join(f"{label} {count}" for label, count in Counter(self.labels).items())
        n_hidden = len(self.edges) - MAX_ROWS
        return [
            f"Points of the grid: {counts}.",
            *[f"{n_hidden} more edges."] * (n_hidden > 0),
            *["Between two points of the grid there are more edges than were located: use more values."]
            * bool(self.n_gaps),
            f"{self.n_runs} runs of the FMU.",
            *(f"{len(self.failures)} of these runs failed, such as {failure}" for failure in self.failures[:1]),
        ]

    def as_json(self) -> dict[str, Any]:
        return {
            "model": self.spec.model,
            "axes": {name: axis.tolist() for name, axis in zip(self.units, self.axes, strict=True)},
            "labels": list(self.labels),
            "edges": self._rows(self.edges),
            "gaps": self.n_gaps,
            "failures": list(self.failures),
        }

    def _origin(self) -> dict[str, Any]:
        fmu, parameters = self.spec.fmu, {name: (value, "") for name, value in self.settings.items()}
        return {"files": [fmu], "parameters": parameters, "source": describe_sources(str(fmu)), "run": self.spec} | {
            "scene": self.options
        }

    def _write_tables(self, folder: Path) -> None:
        self._data_table().write_csv(folder / "map.csv")
        if self.edges:
            ResultTable(self._rows(self.edges), self._columns(), units=self.units).write_csv(folder / "edges.csv")

    def _draw(self, figure: "Figure") -> None:
        from ...results.style import HEIGHT, WIDTH, set_size

        set_size(figure, WIDTH, 1.4 * HEIGHT)
        self._draw_panel(figure.add_subplot())

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_map

        plot_map(axes, self)


def format_value(name: str, row: dict[str, Any]) -> str:
    """Return the value of a parameter at an edge."""
    return f"{row[name]:.12g}"
