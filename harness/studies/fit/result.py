"""A fit with its files, its figure and what the command prints."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analyses.estimation.estimate import ColumnResiduals, Estimate, UsedSamples, shared_json
from ...analyses.fit.parameter_fit import FittedRecord, ParameterFit, Slips
from ...results.files import column_heading, write_csv
from ...results.quantity import format_interval
from ...results.result import Result
from ...results.summary import ResultColumn, ResultTable, limit_remarks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def format_estimate(estimate: Estimate) -> str:
    """Format value and interval; an interval with one end is written as a limit."""
    if isfinite(estimate.error) or not (isfinite(estimate.low) or isfinite(estimate.high)):
        has_interval = isfinite(estimate.low) and isfinite(estimate.high)
        return format_interval(estimate.value, estimate.low, estimate.high) if has_interval else "not determined"
    if isfinite(estimate.low) and isfinite(estimate.high):
        return f"{estimate.low:.3g} to {estimate.high:.3g}"
    return f"> {estimate.low:.3g}" if isfinite(estimate.low) else f"< {estimate.high:.3g}"


VALUES = (
    ResultColumn("parameter", "{0.name}", is_text=True),
    ResultColumn("value, 95 % interval", format_estimate),
    ResultColumn("unit", "{0.unit}", is_text=True),
)
COMPARISON = (
    ResultColumn("law", "{0.fmu}", is_text=True),
    ResultColumn("unknowns", "{0.unknowns}"),
    ResultColumn("residual/noise", "{0.residual:.3f}"),
    ResultColumn("BIC", "{0.bic:.1f}"),
    ResultColumn("above the best", "{0.difference:.1f}"),
)


@dataclass(frozen=True, repr=False)
class FitResult(Result, ParameterFit):
    """Parameters of an FMU that were fitted to records, as `fit` returns them and `load_result` reads them.

    ``result["mu_s"]`` is the estimate of an unknown or of a combination; its attributes are those of `ParameterFit`.
    """

    study, _function = "fit", "fit"

    @property
    def title(self) -> str:
        return f"{self.fmu}: {', '.join(record.name for record in self.records)}"

    @property
    def _headline(self) -> str:
        return ", ".join(
            f"{item.name} = {item.value:.4g} {item.unit}".rstrip()
            if isfinite(item.error)
            else f"{item.name} {format_estimate(item)}"
            for item in self.estimates
        )

    def __getitem__(self, name: str) -> Any:
        """Return the estimate of an unknown or a combination, or a part of the result by its key in the JSON."""
        names = [estimate.name for estimate in (*self.estimates, *self.combinations)]
        if isinstance(name, str) and name not in names and name in (content := self.as_json()):
            return content[name]
        return ParameterFit.__getitem__(self, name)

    @property
    def _caption(self) -> str:
        names = ", ".join(record.name for record in self.records)
        return f"Fit of {self.fmu} to {names}: record, fitted signal, residuals, and profiles of the values"

    def _tabulate(self) -> tuple[ResultTable, ...]:
        """Return the values of each fit, and the comparison of the laws."""
        fits = [tabulate_fit(self, self.title), *(tabulate_fit(law, f"Fit of {law.fmu}") for law in self.against)]
        comparison = self.comparison.laws if self.comparison else ()
        return *fits, ResultTable(comparison, COMPARISON, "Compared laws, best first" if comparison else "")

    def sentences(self) -> list[str]:
        return describe_fit(self)

    def blocks(self) -> list[ResultTable | str]:
        """Return each fit with its sentences, and the comparison with its verdict."""
        (own_table, *other_tables), comparison = self._tabulate()[:-1], self._tabulate()[-1]
        parts: list[ResultTable | str] = [own_table, "", *describe_fit(self)]
        for law, table in zip(self.against, other_tables, strict=True):
            parts += ["", table, "", *describe_fit(law)]
        if self.comparison:
            parts += ["", comparison, ""]
            parts += [] if self.comparison.verdict in self.remarks else [self.comparison.verdict]
        return parts

    def as_json(self) -> dict[str, Any]:
        return fit_as_json(self)

    def _write_tables(self, folder: Path) -> None:
        """Write fit.json and the fitted signals."""
        super()._write_tables(folder)
        laws = (self, *self.against)
        write_fitted_signals(folder / "fit.csv", laws, self.records, [law.predictions for law in laws])
        if self.validation:
            predictions = [law.validation.predictions for law in laws if law.validation]
            write_fitted_signals(folder / "validation.csv", laws, self.validation.records, predictions)

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import fitted_columns, plot_fits

        laws = (self, *self.against)
        plot_fits(axes, laws, fitted_columns(laws)[0])
        axes.set_xlabel("t [s]")


def tabulate_fit(fit: ParameterFit, title: str) -> ResultTable:
    """Return the table of values with 95 % intervals."""
    return ResultTable((*fit.estimates, *fit.combinations), VALUES, title)


def describe_fit(fit: ParameterFit) -> list[str]:
    """Return the sentences on the residuals of a fit, its remarks and its notes."""
    lines = [describe_residuals(column, column.record) for column in fit.columns]
    lines += [
        describe_residuals(column, f"{column.record} (validation)")
        for column in (fit.validation.columns if fit.validation else ())
    ]
    return [*lines, *limit_remarks(fit.remarks), *fit.notes]


def describe_residuals(column: ColumnResiduals, record: str) -> str:
    """Return a sentence on the residuals of a column."""
    return (
        f"Residuals of {column.name} in {record}: {column.residual:.3g} {column.unit}".rstrip()
        + f" (noise {column.noise:.3g}, range {column.range:.3g})."
    )


def fit_as_json(fit: ParameterFit) -> dict[str, Any]:
    """Return a fit for JSON output."""
    comparison = {"against": [fit_as_json(law) for law in fit.against], "comparison": fit.comparison}
    samples = [
        UsedSamples(record.name, record.sampled_t, len(record.sampled_t), record.width) for record in fit.records
    ]
    return {
        "fmu": fit.fmu,
        **shared_json(samples, fit.columns, fit.estimates, fit.remarks),
        "notes": list(fit.notes),
        "describes_record": fit.describes_record,
        "undetermined": list(fit.undetermined),
        "combinations": [asdict(estimate) for estimate in fit.combinations],
        "profiles": [asdict(profile) for profile in fit.profiles],
        "correlation": fit.correlation.tolist(),
        "validation": [asdict(column) for column in fit.validation.columns] if fit.validation else [],
        "slips": [slips_as_json(slips) for slips in fit.slips],
        "bic": fit.bic,
        "searches": fit.n_searches,
        "runs": fit.n_runs,
        "log": list(fit.log),
        **(comparison if fit.against else {}),
    }


def slips_as_json(slips: Slips) -> dict[str, Any]:
    """Return slips for JSON output."""
    values = {"t": slips.t, "before": slips.before, "after": slips.after, "drop": slips.drop, "waiting": slips.waiting}
    texts = {"record": slips.record, "column": slips.column, "unit": slips.unit}
    return texts | {name: numbers.tolist() for name, numbers in values.items()}


def write_fitted_signals(
    path: Path,
    laws: Sequence[ParameterFit],
    records: Sequence[FittedRecord],
    predictions: Sequence[Sequence[np.ndarray]],
) -> None:
    """Write records, and the prediction of each law for them."""
    headings = ["record", "t [s]"]
    numbers = np.concatenate([np.full(len(record.t), float(i + 1)) for i, record in enumerate(records)])
    columns = [numbers, np.concatenate([record.t for record in records])]
    for j, column in enumerate(laws[0].columns[: predictions[0][0].shape[1]]):
        samples = np.concatenate([record.y[:, j] for record in records])
        headings.append(column_heading(column.name, column.unit))
        columns.append(samples)
        for law, signals in zip(laws, predictions, strict=True):
            prediction = np.concatenate([signal[:, j] for signal in signals])
            name = "" if law is laws[0] else f" {law.fmu}"
            headings += [
                column_heading(f"{column.name}{suffix}{name}", column.unit) for suffix in (" fit", " residual")
            ]
            columns += [prediction, samples - prediction]
    write_csv(path, headings, columns)
