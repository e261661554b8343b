"""Identified friction over velocity with its files, its figure and what the command prints."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analyses.curve.identification import CurveIdentification
from ...results.files import column_heading, to_json, write_csv
from ...results.result import Result
from ...results.summary import Summary
from .model_file import LAW_MODEL, TABLE_MODEL, table_file, write_law_model, write_table_model
from .model_values import model_values, tabulate
from .table import constants_table, laws_table, models_table, sentences, summarize_curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class CurveResult(Result, CurveIdentification):
    """Friction over velocity, as `identify_curve` returns it and `load_result` reads it.

    ``result["F_c"]`` is the estimate of a constant of the best law; its attributes are those of `CurveIdentification`.
    """

    study, function = "curve", "identify_curve"

    @property
    def title(self) -> str:
        return self.points.name

    @property
    def headline(self) -> str:
        constants = ", ".join(f"{item.name} = {item.value:.4g} {item.unit}" for item in self.estimates)
        return f"{self.best.name}: {constants}"

    def __getitem__(self, name: str) -> Any:
        """Return the estimate of a constant of the best law, or a part of the result by its key in the JSON."""
        if isinstance(name, str) and name not in self.best.values and name in (content := self.as_json()):
            return content[name]
        return CurveIdentification.__getitem__(self, name)

    @property
    def models(self) -> dict[str, dict[str, float | str]]:
        """Values of the parameters of models of this project, by the name of the model."""
        return model_values(self)

    def table(self) -> dict[str, np.ndarray]:
        """Return the measured friction over the speed.

        Returns
        -------
        dict
            Arrays (n,): `speed` in m/s or rad/s, and `friction`, `forward` and `backward` in N or N.m.
        """
        return tabulate(self)

    def summary(self) -> Summary:
        return summarize_curve(self)

    def blocks(self) -> list[Any]:
        tables = [constants_table(self.best, self.title), laws_table(self), models_table(self)]
        return [*(block for table in tables if table.row_count for block in (table, "")), *sentences(self)]

    def rows(self) -> tuple[list[Mapping[str, Any]], str]:
        return [asdict(estimate) for estimate in self.estimates], "name"

    def as_json(self) -> dict[str, Any]:
        points, residuals = self.points, self.residuals
        return {
            "record": points.name,
            "velocity_unit": points.velocity_unit,
            "force_unit": points.force_unit,
            "sentence": self.sentence,
            "law": self.best.name,
            "fit": [asdict(estimate) for estimate in self.estimates],
            "bias": self.best.bias,
            "residual": self.best.residual,
            "points": len(points.v),
            "outliers": [
                {
                    "label": points.labels[i],
                    "velocity": float(points.v[i]),
                    "force": float(points.force[i]),
                    "residual": float(residuals[i]),
                }
                for i in np.flatnonzero(~self.used)
            ],
            "laws": [
                {
                    "name": fit.name,
                    "text": fit.law.text,
                    "bic": fit.bic,
                    "residual": fit.residual,
                    "fit": [asdict(estimate) for estimate in fit.estimates],
                }
                for fit in self.laws
            ],
            "unavailable": dict(self.unavailable),
            "models": self.models,
            "remarks": list(self.remarks),
            "notes": list(points.notes),
        }

    def write_tables(self, folder: Path) -> None:
        """Write curve.json, points, tables and model files."""
        points = self.points
        velocity, force = points.velocity_unit, points.force_unit
        (folder / "curve.json").write_text(to_json(self.as_json()) + "\n", encoding="utf-8")
        headings = [column_heading("v", velocity), *(column_heading(name, force) for name in ("F", "fit", "residual"))]
        columns = [points.v, points.force, self.best.force(points.v), self.residuals, self.used.astype(int)]
        write_csv(folder / "curve.csv", [*headings, "used"], columns)
        headings = [column_heading("speed", velocity), column_heading("friction", force)]
        speed, *frictions = self.table().items()
        for name, values in frictions:  # as `Table` of a model file reads them: two columns
            write_csv(folder / table_file(name), headings, [speed[1], values])
        (folder / LAW_MODEL).write_text(write_law_model(self), encoding="utf-8")
        (folder / TABLE_MODEL).write_text(write_table_model(self), encoding="utf-8")

    def draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_force

        plot_force(axes, self)
