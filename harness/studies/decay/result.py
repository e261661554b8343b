"""An identified decay with its files, its figure and what the command prints."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analyses.decay.identification import DecayIdentification
from ...analyses.decay.law import AMPLITUDE, T0
from ...analyses.estimation.estimate import ColumnResiduals, Estimate, UsedSamples, shared_json
from ...results.files import column_heading, write_csv
from ...results.quantity import format_interval
from ...results.result import Result
from ...results.summary import ResultColumn, ResultTable, limit_remarks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def format_estimate(estimate: Estimate | None) -> str:
    """Return value and interval; empty without an estimate."""
    return format_interval(estimate.value, estimate.low, estimate.high) if estimate else ""


VALUE = "value to use, 95 % interval"  # from the whole signal
UNIT = ResultColumn("unit", lambda estimate: "" if estimate.unit == "1" else estimate.unit, is_text=True)


@dataclass(frozen=True, repr=False)
class DecayResult(Result, DecayIdentification):
    """The result of the identification of a decay, as `identify_decay` returns it and `load_result` reads it.

    ``result["zeta"]`` is the estimate of a constant from the whole signal; its attributes are those of
    `DecayIdentification`.
    """

    study, _function = "decay", "identify_decay"

    @property
    def title(self) -> str:
        return self.record.name

    @property
    def _headline(self) -> str:
        return ", ".join(f"{estimate.name} = {estimate.value:.4g} {estimate.unit}" for estimate in self.estimates)

    def __getitem__(self, name: str) -> Any:
        """Return the estimate of a constant from the whole signal, or a part of the result by its key in the JSON."""
        names = [estimate.name for estimate in self.estimates]
        if isinstance(name, str) and name not in names and name in (content := self.as_json()):
            return content[name]
        return DecayIdentification.__getitem__(self, name)

    @property
    def _caption(self) -> str:
        return f"Decay of {self.title}: signal, turning points, envelope and fit, and residuals. {self.sentence}"

    def _tabulate(self) -> tuple[ResultTable, ...]:
        """Return the values to use, and below them those from the turning points and from two peaks as checks."""
        checks = [{item.name: item for item in items} for items in (self.extrema_estimates, self.two_peak_estimates)]
        checked_estimates = [item for item in self.estimates if any(item.name in values for values in checks)]
        from_extrema, from_peaks = checks
        columns = (
            ResultColumn("turning points", lambda item: format_estimate(from_extrema.get(item.name))),
            ResultColumn("two peaks (rough)", lambda item: format_estimate(from_peaks.get(item.name))),
        )
        values = (
            ResultColumn("quantity", "{0.text}, {0.name}", is_text=True),
            ResultColumn(VALUE, format_estimate),
            UNIT,
        )
        return ResultTable(self.estimates, values, self.title), ResultTable(
            checked_estimates, (ResultColumn("check", "{0.name}", is_text=True), *columns, UNIT)
        )

    def _tabulate_details(self) -> tuple[ResultTable, ...]:
        """Return the combinations of losses."""
        samples, scale = len(self.t), self.problem.scale
        columns = (
            ResultColumn("losses", "{0.description}", is_text=True),
            ResultColumn("BIC, smaller is better", "{0.bic:.1f}"),
            ResultColumn(
                f"rms residual [{self.record.unit}]",
                lambda law: f"{np.sqrt(law.sum_of_squares / samples) * scale:.3g}",
            ),
        )
        return (ResultTable(self.laws, columns, "Combinations of losses, best first"),)

    def sentences(self) -> list[str]:
        lines = [self.sentence]
        lines += [f"No {name}: {reason}." for name, reason in self.unavailable.items() if reason]
        if self.two_peak_estimates and len(self.best.terms) > 1:
            lines.append(
                "The values from two peaks are rough checks: each attributes the whole loss to one mechanism, and is "
                "too large if several act."
            )
        t, record = self.t, self.record
        n_excluded = len(record.t) - len(t)
        if n_excluded:
            lines.append(
                f"Fitted to {record.quantity} from t = {record.format_time(t[0])} to {record.format_time(t[-1])} s; "
                f"{n_excluded} of {len(record.t)} samples are excluded (before release, after the last reliable cycle, "
                "or outliers)."
            )
        return [*lines, *limit_remarks(self.remarks)]

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

    def _write_tables(self, folder: Path) -> None:
        """Write decay.json, turning points and fit."""
        name, unit = self.record.symbol, self.record.unit
        super()._write_tables(folder)
        turning_points = ["t [s]", column_heading("x", self.record.base)]
        write_csv(folder / "turning-points.csv", turning_points, [self.extrema.t, self.extrema.x])
        headings = ["t [s]", *(column_heading(text, unit) for text in (name, "fit", "residual"))]
        write_csv(folder / "fit.csv", headings, [self.t, self.x, self.fit_values, self.x - self.fit_values])

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_signal

        plot_signal(axes, self)
        axes.set_xlabel("t [s]")
