"""A fit with its files, its figure and what the command prints."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analyses.estimation.estimate import UsedSamples, shared_json
from ...analyses.fit.parameter_fit import FittedRecord, ParameterFit, Slips
from ...results.files import column_heading, to_json, write_csv
from ...results.result import Result
from ...results.summary import Summary
from .table import format_estimate, result_parts, summarize_fit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class FitResult(Result, ParameterFit):
    """Parameters of an FMU that were fitted to records, as `fit` returns them and `load_result` reads them.

    ``result["mu_s"]`` is the estimate of an unknown or of a combination; its attributes are those of `ParameterFit`.
    """

    study, function = "fit", "fit"

    @property
    def title(self) -> str:
        return f"{self.fmu}: {', '.join(record.name for record in self.records)}"

    @property
    def headline(self) -> str:
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

    def summary(self) -> Summary:
        return summarize_fit(self)

    def blocks(self) -> list[Any]:
        return list(result_parts(self))

    def rows(self) -> tuple[list[Mapping[str, Any]], str]:
        return [asdict(estimate) for estimate in (*self.estimates, *self.combinations)], "name"

    def as_json(self) -> dict[str, Any]:
        return fit_as_json(self)

    def write_tables(self, folder: Path) -> None:
        """Write fit.json and the fitted signals."""
        (folder / "fit.json").write_text(to_json(self.as_json()) + "\n", encoding="utf-8")
        laws = (self, *self.against)
        write_fitted_signals(folder / "fit.csv", laws, self.records, [law.predictions for law in laws])
        if self.validation:
            predictions = [law.validation.predictions for law in laws if law.validation]
            write_fitted_signals(folder / "validation.csv", laws, self.validation.records, predictions)

    def draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def draw_panel(self, axes: "Axes") -> None:
        from .figure import fitted_columns, plot_fits

        laws = (self, *self.against)
        plot_fits(axes, laws, fitted_columns(laws)[0])
        axes.set_xlabel("t [s]")


def fit_as_json(fit: ParameterFit) -> dict[str, Any]:
    """Return a fit for JSON output."""
    comparison = {"against": [fit_as_json(law) for law in fit.against], "comparison": fit.comparison}
    used = [UsedSamples(record.name, record.sampled_t, len(record.sampled_t), record.width) for record in fit.records]
    return {
        "fmu": fit.fmu,
        **shared_json(used, fit.columns, fit.estimates, fit.remarks),
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
        measured = np.concatenate([record.y[:, j] for record in records])
        headings.append(column_heading(column.name, column.unit))
        columns.append(measured)
        for law, signals in zip(laws, predictions, strict=True):
            fitted = np.concatenate([signal[:, j] for signal in signals])
            name = "" if law is laws[0] else f" {law.fmu}"
            headings += [
                column_heading(f"{column.name}{suffix}{name}", column.unit) for suffix in (" fit", " residual")
            ]
            columns += [fitted, measured - fitted]
    write_csv(path, headings, columns)
