"""Study that fits the parameters of an FMU to record files, and writes the result folder."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from os.path import exists
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from ...analyses.estimation.estimate import ColumnResiduals, UsedSamples, shared_json
from ...analyses.fit.fit_description import describe_fit
from ...analyses.fit.fit_procedure import fit_records
from ...analyses.fit.law_comparison import compare_laws
from ...analyses.fit.measured_record import MeasuredRecord
from ...analyses.fit.parameter_fit import ParameterFit
from ...analyses.fit.validation import validate
from ...errors import HarnessError, SceneError, format_value
from ...records.signal_table import SignalTable, parse_signals
from ...records.table_files import Table, load_table
from ...results import provenance
from ...results.files import column_heading, to_json, write_csv
from ...results.folder import replace_folder
from ...results.summary import write_summary
from ...running.native_equivalent import native_equivalent
from ...running.whole_run import open_simulator
from .laws import ResolvedLaws, resolve_laws
from .observed import choose_observed
from .request import FitRequest, ResolvedRequest, make_unknowns, record_data
from .table import summarize_fit

FOLDER = "fit"
FILES = ("fit.json", "fit.csv", "validation.csv", "figure.svg")


def fit_files(
    request: FitRequest,
    files: Sequence[str],
    validation: Sequence[str],
    out: Path,
    report: Callable[[float], None],
) -> tuple[ParameterFit, Path]:
    """Fit the parameters of an FMU to record files, and write the result to out/fit/<record>.

    Parameters
    ----------
    validation : sequence of str
        Record files that are predicted, but not fitted.
    """
    records, others = ([load_record(file, request) for file in group] for group in (files, validation))
    request, choice = choose_observed(request, records[0].table)
    laws = resolve_laws(request).with_note(choice)
    folder = out / FOLDER / records[0].name
    source = provenance.describe_sources(*files)
    with replace_folder(folder, FILES, source) as new_folder:
        fit = fit_laws(laws, records, others, report)
        write_results(fit, new_folder)
        paths = [request.run.fmu, *request.against, *(Path(file) for file in (*files, *validation) if file != "-")]
        scene = {name: value for name, value in vars(request).items() if name not in ("run", "columns", "against")}
        scene |= {"fixed": request.run.values, "timeout": request.run.timeout}
        parameters = {name: (value, "") for name, value in request.run.values.items()}
        provenance.write_provenance(new_folder, files=paths, parameters=parameters, scene=scene, source=source)
        write_summary(new_folder, summarize_fit(fit))
    return fit, folder


@dataclass(frozen=True)
class RecordTable:
    """Table of a record, and the name of the record."""

    name: str
    table: Table


def load_record(source: str, request: FitRequest) -> RecordTable:
    """Load the table in a file."""
    if source != "-" and not exists(source):
        raise SceneError(f"{format_value(source)} does not exist: give an existing record")
    name = "stdin" if source == "-" else Path(source).stem.encode("utf-8", "replace").decode()
    return RecordTable(name, load_table(source, request.columns.names))


def fit_laws(
    laws: ResolvedLaws,
    records: Sequence[RecordTable],
    validation: Sequence[RecordTable],
    report: Callable[[float], None],
) -> ParameterFit:
    """Fit an FMU, and the FMUs to compare it with, to the same records, and predict the validation records.

    All fits use the same samples: if one of them cannot use means of neighbouring samples, none of them does.
    """
    count, fits = len(laws.requests), []

    def fit_law(i: int, averages: bool) -> ParameterFit:
        law = laws.requests[i]
        tables, others = (
            [parse_signals(record.table, law.sources, law.request.columns, record.name) for record in group]
            for group in (records, validation)
        )
        try:
            fit = fit_tables(law, tables, lambda share: report((i + share) / count), averages, others)
        except HarnessError as error:
            if count > 1:
                error.args = (f"{law.name}: {error}", *error.args[1:])
            raise
        return replace(fit, notes=(*fit.notes, *laws.notes[i]))

    fits = [fit_law(i, averages=True) for i in range(count)]
    if len({fit.n_samples for fit in fits}) > 1:
        most = max(fit.n_samples for fit in fits)
        fits = [fit if fit.n_samples == most else fit_law(i, averages=False) for i, fit in enumerate(fits)]
    if count == 1:
        return fits[0]
    comparison = compare_laws(fits)
    is_worse = comparison.is_clear and comparison.laws[0].fmu != fits[0].fmu
    remarks = (*fits[0].remarks, comparison.verdict) if is_worse else fits[0].remarks
    others = tuple(convert_outputs(fit, fits[0]) for fit in fits[1:])
    return replace(fits[0], remarks=remarks, against=others, comparison=comparison)


def convert_outputs(fit: ParameterFit, target: ParameterFit) -> ParameterFit:
    """Return a fit with its outputs in the units of another fit to the same records."""
    columns = convert_columns(fit.columns, target.columns)
    outputs = fit.predictions[0].shape[1]
    factors = [other.noise / own.noise for own, other in zip(fit.columns, target.columns, strict=True)][:outputs]
    validation = fit.validation
    if validation and target.validation:
        validation = replace(
            validation,
            columns=convert_columns(validation.columns, target.validation.columns),
            records=target.validation.records,
            predictions=tuple(prediction * factors for prediction in validation.predictions),
        )
    return replace(
        fit,
        columns=columns,
        records=target.records,
        predictions=tuple(prediction * factors for prediction in fit.predictions),
        validation=validation,
    )


def convert_columns(
    columns: Sequence[ColumnResiduals], targets: Sequence[ColumnResiduals]
) -> tuple[ColumnResiduals, ...]:
    """Return the residuals of columns in the units of target columns, which have the same samples and noise."""
    return tuple(
        replace(target, residual=own.residual * (target.noise / own.noise))
        for own, target in zip(columns, targets, strict=True)
    )


def fit_tables(
    resolved: ResolvedRequest,
    tables: Sequence[SignalTable],
    report: Callable[[float], None],
    averages: bool = True,
    validation: Sequence[SignalTable] = (),
) -> ParameterFit:
    """Fit the parameters of an FMU to the signals in tables.

    Parameters
    ----------
    averages : bool
        Whether long records may be fitted as means of neighbouring samples.
    validation : sequence of SignalTable
        Records that are predicted, but not fitted.

    Raises
    ------
    SceneError
        If the request does not fit the records.
    HarnessError
        If the fit fails.
    """
    request, start_time = resolved.request, process_time()
    if validation and request.each and len(tables) > 1:
        raise SceneError(
            f"{', '.join(request.each)} has a value of its own for each record, and none for the validation record: "
            "leave out --each or --validate"
        )
    data = [record_data(resolved, table) for table in tables]
    unknowns = make_unknowns(resolved, data)
    with open_simulator(replace(resolved.shared, fmu=native_equivalent(request.run.fmu))) as simulator:
        problem, raw_fit = fit_records(simulator, data, unknowns, resolved.fixed, request.robust, report, averages)
        prediction = (
            validate(problem, raw_fit, [record_data(resolved, table) for table in validation]) if validation else None
        )
        notes = [note for table in (*tables, *validation) for note in table.notes]
        fit = describe_fit(resolved.name, problem, raw_fit, notes, simulator.n_runs, process_time() - start_time)
    units = {name: resolved.variables[name].unit for name in request.observe}
    fit = replace(fit, columns=set_units(fit.columns, units))
    if prediction:
        prediction = replace(prediction, columns=set_units(prediction.columns, units))
        fit = replace(fit, validation=prediction, remarks=(*fit.remarks, *prediction.remarks))
    return fit


def set_units(columns: Sequence[ColumnResiduals], units: Mapping[str, str]) -> tuple[ColumnResiduals, ...]:
    """Return columns with the units of their variables."""
    return tuple(replace(column, unit=units[column.name]) for column in columns)


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
        "bic": fit.bic,
        "searches": fit.n_searches,
        "runs": fit.n_runs,
        "log": list(fit.log),
        **(comparison if fit.against else {}),
    }


def write_results(fit: ParameterFit, folder: Path) -> None:
    """Write fit.json, the fitted signals, and the figure."""
    from .figure import draw

    (folder / "fit.json").write_text(to_json(fit_as_json(fit)) + "\n", encoding="utf-8")
    laws = (fit, *fit.against)
    write_fitted_signals(folder / "fit.csv", laws, fit.records, [law.predictions for law in laws])
    if fit.validation:
        predictions = [law.validation.predictions for law in laws if law.validation]
        write_fitted_signals(folder / "validation.csv", laws, fit.validation.records, predictions)
    draw(fit, folder / "figure.svg")


def write_fitted_signals(
    path: Path,
    laws: Sequence[ParameterFit],
    records: Sequence[MeasuredRecord],
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
