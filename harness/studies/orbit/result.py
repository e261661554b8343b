"""Periodic motions and special points, with their files, their figure and what the command prints."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import HarnessError
from ...results.files import column_heading
from ...results.provenance import describe_sources
from ...results.result import Result
from ...results.summary import ResultColumn, ResultTable
from ...scenes.run_spec import RunSpec
from ...simulation.motion import Motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class SpecialPoint:
    """A value of the parameter at which motions begin, end or change.

    Attributes
    ----------
    value : float
        Value of the parameter.
    kind : str
        What happens as the parameter increases.
    largest : float
        Largest value of the coordinate there.
    how : str
        How the value was found.
    """

    value: float
    kind: str
    largest: float
    how: str


@dataclass(frozen=True, repr=False)
class OrbitResult(Result):
    """Periodic motions of a model, over a parameter or at one point.

    Attributes
    ----------
    spec : RunSpec
        FMU and values.
    parameter, unit : str
        Parameter that varies, and its unit; empty for none.
    coordinate, rate, coordinate_unit : str
        State that measures the motions, without translations, its rate, and its unit.
    motions : tuple of Motion
        Motions, by value of the parameter.
    points : tuple of SpecialPoint
        Special points.
    paths : tuple of numpy.ndarray
        Without a parameter, a period (points, 4) of each motion: time in s, coordinate, rate, and 1 where it returns.
    remarks : tuple of str
        What is neither at rest nor periodic.
    n_runs : int
        Number of runs of the FMU.
    settings : dict
        Effective values of the parameters.
    options : dict
        Values of the parameter that varies, section, and period, if they are set.
    """

    study, _function = "orbit", "orbit"

    spec: RunSpec
    parameter: str
    unit: str
    coordinate: str
    rate: str
    coordinate_unit: str
    motions: tuple[Motion, ...]
    points: tuple[SpecialPoint, ...]
    paths: tuple[np.ndarray, ...]
    remarks: tuple[str, ...]
    n_runs: int
    settings: dict[str, Any]
    options: dict[str, Any]

    @property
    def title(self) -> str:
        return f"{self.spec.model} over {self.parameter}" if self.parameter else self.spec.model

    @property
    def _headline(self) -> str:
        return f"{len(self.motions)} motions, {len(self.points)} special points"

    @property
    def _caption(self) -> str:
        return f"{self.title}: turning points of {self.coordinate} of all motions; unstable ones are dashed"

    def _tabulate(self) -> tuple[ResultTable, ...]:
        """Return the motions, of several values only the special points."""
        points = ResultTable(self.points, self._point_columns(), "Special points")
        return (points,) if self.parameter and self.points else (self._data_table(), points)

    def _rows(self) -> list[dict[str, Any]]:
        """Return the numbers of each motion by name, as files and pandas have them."""
        names = ("stability", "period", "amplitude", "largest", "smallest", "stick_time", "slip_time")
        return [
            {self.parameter or "model": motion.value, "motion": motion.kind}
            | {name: getattr(motion, name) for name in names}
            | {"sticks": motion.n_sticks, "multiplier": motion.multiplier, "growth": motion.growth}
            for motion in self.motions
        ]

    def _data_table(self) -> ResultTable:
        return ResultTable(self._rows(), self._motion_columns())

    def _motion_columns(self) -> tuple[ResultColumn, ...]:
        value = ResultColumn(column_heading(self.parameter, self.unit), f"{{0[{self.parameter}]:.6g}}")
        return (
            *[value] * bool(self.parameter),
            ResultColumn("motion", lambda row: f"{row['stability']} {row['motion']}".strip(), is_text=True),
            ResultColumn("period [s]", "{0[period]:.8g}"),
            ResultColumn(column_heading("amplitude", self.coordinate_unit), "{0[amplitude]:.6g}"),
            ResultColumn("stick [s]", "{0[stick_time]:.6g}"),
            ResultColumn("sticks", "{0[sticks]}"),
            ResultColumn("multiplier", "{0[multiplier]:.4g}"),
        )

    def _point_columns(self) -> tuple[ResultColumn, ...]:
        return (
            ResultColumn(column_heading(self.parameter, self.unit), "{0.value:.12g}"),
            ResultColumn("what happens", "{0.kind}", is_text=True),
            ResultColumn("located by", "{0.how}", is_text=True),
        )

    def sentences(self) -> list[str]:
        """Return what was not found, and the number of runs."""
        return [*self.remarks, f"{self.n_runs} runs of the FMU."]

    def as_json(self) -> dict[str, Any]:
        return {
            "model": self.spec.model,
            "parameter": self.parameter,
            "coordinate": self.coordinate,
            "motions": [
                {name: None if value != value else value for name, value in row.items()} for row in self._rows()
            ],
            "points": [vars(point) for point in self.points],
            "remarks": list(self.remarks),
        }

    def _origin(self) -> dict[str, Any]:
        fmu, parameters = self.spec.fmu, {name: (value, "") for name, value in self.settings.items()}
        return {"files": [fmu], "parameters": parameters, "source": describe_sources(str(fmu)), "run": self.spec} | {
            "scene": self.options
        }

    def _write_tables(self, folder: Path) -> None:
        if self.motions:
            self._data_table().write_csv(folder / "motions.csv")
        if self.points:
            ResultTable(self.points, self._point_columns()).write_csv(folder / "points.csv")

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_diagram, plot_phase_plane

        if not self.motions:
            raise HarnessError(f"{self.title} has no motions to plot")
        (plot_diagram if self.parameter else plot_phase_plane)(axes, self)
