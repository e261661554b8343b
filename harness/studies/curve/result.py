"""Identified friction over velocity with its files, its figure and what the command prints."""

from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analyses.curve.identification import CurveIdentification
from ...analyses.estimation.estimate import Estimate
from ...errors import option_text
from ...results.files import column_heading, write_csv
from ...results.quantity import format_interval
from ...results.result import Result
from ...results.summary import ResultColumn, ResultTable, limit_remarks
from .model_file import (
    LAW_MODEL,
    LINEAR_FORCE,
    TABLE_MODEL,
    assignments,
    law_of_models,
    model_values,
    table_file,
    tabulate_friction,
    write_law_model,
    write_table_model,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def format_estimate(estimate: Estimate) -> str:
    """Format value and interval; an interval with one end is written as a limit."""
    if isfinite(estimate.high) or not isfinite(estimate.low):
        return format_interval(estimate.value, estimate.low, estimate.high)
    return f"{estimate.value:.3g} (> {estimate.low:.3g})"


CONSTANTS = (
    ResultColumn("constant", "{0.text}, {0.name}", is_text=True),
    ResultColumn("value, 95 % interval", format_estimate),
    ResultColumn("unit", "{0.unit}", is_text=True),
)
MODELS = (ResultColumn("model", "{0[model]}", is_text=True), ResultColumn("options", "{0[options]}", is_text=True))


@dataclass(frozen=True, repr=False)
class CurveResult(Result, CurveIdentification):
    """Friction over velocity, as `identify_curve` returns it and `load_result` reads it.

    ``result["F_c"]`` is the estimate of a constant of the best law; its attributes are those of `CurveIdentification`.
    """

    study, _function = "curve", "identify_curve"

    @property
    def title(self) -> str:
        return self.points.name

    @property
    def _headline(self) -> str:
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
        return tabulate_friction(self)

    @property
    def _caption(self) -> str:
        text = "over velocity: points of both directions, laws and residuals"
        return f"Friction of {self.title} {text}. {self.sentence}"

    def _tabulate(self) -> tuple[ResultTable, ...]:
        """Return the constants of the best law, all laws, and values for models."""
        best = self.best.bic
        laws = (
            ResultColumn("law", "{0.name}", is_text=True),
            ResultColumn("constants", lambda fit: str(len(fit.estimates))),
            ResultColumn(f"residual [{self.points.force_unit}]", "{0.residual:.3g}"),
            ResultColumn("BIC", "{0.bic:.1f}"),
            ResultColumn("above the best", lambda fit: f"{fit.bic - best:.1f}"),
        )
        models = [{"model": name, "options": assignments(values)} for name, values in self.models.items()]
        return (
            ResultTable(self.estimates, CONSTANTS, self.title),
            ResultTable(self.laws, laws, "Laws, best first"),
            ResultTable(models, MODELS, "Values for models"),
        )

    def sentences(self) -> list[str]:
        n_used, count = int(self.used.sum()), len(self.points.v)
        fit, unit = self.best, self.points.force_unit
        lines = [self.sentence, f"Residual of {n_used} of {count} points: {fit.residual:.3g} {unit}."]
        for reason in dict.fromkeys(self.unavailable.values()):
            laws = [name for name, text in self.unavailable.items() if text == reason]
            lines.append(f"Not fitted: {', '.join(laws)}; {reason}.")
        return [*lines, *describe_models(self), *limit_remarks(self.remarks), *self.points.notes]

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

    def _write_tables(self, folder: Path) -> None:
        """Write curve.json, points, tables and model files."""
        points = self.points
        velocity, force = points.velocity_unit, points.force_unit
        super()._write_tables(folder)
        headings = [column_heading("v", velocity), *(column_heading(name, force) for name in ("F", "fit", "residual"))]
        columns = [points.v, points.force, self.best.force(points.v), self.residuals, self.used.astype(int)]
        write_csv(folder / "curve.csv", [*headings, "used"], columns)
        headings = [column_heading("speed", velocity), column_heading("friction", force)]
        speed, *frictions = self.table().items()
        for name, values in frictions:  # as `Table` of a model file reads them: two columns
            write_csv(folder / table_file(name), headings, [speed[1], values])
        (folder / LAW_MODEL).write_text(write_law_model(self), encoding="utf-8")
        (folder / TABLE_MODEL).write_text(write_table_model(self), encoding="utf-8")

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_force

        plot_force(axes, self)


def describe_models(identification: CurveIdentification) -> list[str]:
    """Return the sentences on the values for models."""
    fit, best = law_of_models(identification), identification.best
    if identification.points.force_unit != LINEAR_FORCE:
        return [f"The models of this project with such friction move along a line; {LAW_MODEL} rotates."]
    if fit is None:
        return [f"No model of this project has this friction; {LAW_MODEL} has it."]
    lines = []
    if fit.name != best.name:
        lines.append(
            f"The models have the law {fit.name}, whose BIC is larger by {fit.bic - best.bic:.1f}; {LAW_MODEL} has "
            "the best law."
        )
    if identification.mass is None:
        lines.append(f"stickslip needs the mass for its coefficients of friction: give it by {option_text('mass')}.")
    return lines
