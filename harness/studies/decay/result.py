"""An identified decay with its files, its figure and what the command prints."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analyses.decay.identification import DecayIdentification
from ...analyses.decay.law import AMPLITUDE, T0
from ...analyses.estimation.estimate import ColumnResiduals, UsedSamples, shared_json
from ...results.files import column_heading, to_json, write_csv
from ...results.result import Result
from ...results.summary import Summary
from .table import check_table, decay_table, summarize_decay, summary_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class DecayResult(Result, DecayIdentification):
    """The result of the identification of a decay, as `identify_decay` returns it and `load_result` reads it.

    ``result["zeta"]`` is the estimate of a constant from the whole signal; its attributes are those of
    `DecayIdentification`.
    """

    study, function = "decay", "identify_decay"

    @property
    def title(self) -> str:
        return self.record.name

    @property
    def headline(self) -> str:
        return ", ".join(f"{estimate.name} = {estimate.value:.4g} {estimate.unit}" for estimate in self.estimates)

    def __getitem__(self, name: str) -> Any:
        """Return the estimate of a constant from the whole signal, or a part of the result by its key in the JSON."""
        names = [estimate.name for estimate in self.estimates]
        if isinstance(name, str) and name not in names and name in (content := self.as_json()):
            return content[name]
        return DecayIdentification.__getitem__(self, name)

    def summary(self) -> Summary:
        return summarize_decay(self)

    def blocks(self) -> list[Any]:
        tables = [table for table in (decay_table(self), check_table(self)) if table.row_count]
        return [*(block for table in tables for block in (table, "")), *summary_lines(self)]

    def rows(self) -> tuple[list[Mapping[str, Any]], str]:
        return [asdict(estimate) for estimate in self.estimates], "name"

    def as_json(self) -> dict[str, Any]:
        problem, record, best = self.problem, self.record, self.best
        loss = self.energy_loss
        samples = UsedSamples(record.name, self.t, len(record.t))
        noise = problem.noise * problem.scale
        column = ColumnResiduals(record.name, record.symbol, record.unit, self.rms, noise, float(np.ptp(self.x)))
        return {
            **shared_json([samples], [column], self.estimates, self.remarks),
            "quantity": record.quantity,
            "unit": record.unit,
            "sentence": self.sentence,
            "noise": self.extrema.noise,
            "residual": self.rms,
            "turning points": len(self.extrema.t),
            "used": samples.as_json(),
            "release": {
                "time": float(best.p[T0]) + problem.time_origin,
                "amplitude": float(best.p[AMPLITUDE]) * problem.scale,
                "unit": record.base,
            },
            "turning_points": [asdict(estimate) for estimate in self.extrema_estimates],
            "low_speed_rise": {
                "shown": self.rise.is_shown,
                "size": self.rise.size,
                "relative_speed": self.rise.speed,
                "limit": self.rise.limit if np.isfinite(self.rise.limit) else None,
                "unit": record.base,
            }
            if self.rise
            else None,
            "published": [asdict(estimate) for estimate in self.two_peak_estimates],
            "why_empty": {name: reason for name, reason in self.unavailable.items() if reason},
            "laws": [
                {
                    "terms": list(law.terms),
                    "bic": law.bic,
                    "residual": float(np.sqrt(law.sum_of_squares / len(self.t))) * problem.scale,
                }
                for law in self.laws
            ],
            "loss": {
                "unit": record.base,
                "amplitude": loss.amplitude.tolist(),
                "share_of_energy": loss.fraction.tolist(),
                "laws": {"+".join(law.terms): loss.curves[law.terms][1].tolist() for law in self.laws},
                "laws_amplitude": {"+".join(law.terms): loss.curves[law.terms][0].tolist() for law in self.laws},
            },
        }

    def write_tables(self, folder: Path) -> None:
        """Write decay.json, turning points and fit."""
        name, unit = self.record.symbol, self.record.unit
        (folder / "decay.json").write_text(to_json(self.as_json()) + "\n", encoding="utf-8")
        turning_points = ["t [s]", column_heading("x", self.record.base)]
        write_csv(folder / "turning-points.csv", turning_points, [self.extrema.t, self.extrema.x])
        headings = ["t [s]", *(column_heading(text, unit) for text in (name, "fit", "residual"))]
        write_csv(folder / "fit.csv", headings, [self.t, self.x, self.fit_values, self.x - self.fit_values])

    def draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_signal

        plot_signal(axes, self)
        axes.set_xlabel("t [s]")
