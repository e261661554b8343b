"""Study that fits the parameters of one FMU, or of several with other laws, to records.

In a comparison of laws, each FMU frees and fixes those names that it has.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import chain
from os.path import basename, exists
from pathlib import Path
from time import process_time

from ...analyses.estimation.estimate import ColumnResiduals
from ...analyses.fit.fit_description import describe_fit, validate
from ...analyses.fit.fit_procedure import fit_records
from ...analyses.fit.parameter_fit import ParameterFit, compare_laws
from ...analyses.fit.search import ROUGH
from ...analyses.fit.slips import irregular_slips
from ...errors import HarnessError, SceneError, check_names, format_value, option_text
from ...records.columns import ColumnOptions
from ...records.extraction import Samples
from ...records.record import Record, load_record
from ...results.provenance import load_provenance
from ...simulation.derivative_runs import DerivativeRuns
from ...simulation.fmu_archive import read_description
from ...simulation.model_data import read_tables_with
from ...simulation.native_equivalent import native_equivalent
from ...simulation.whole_run import open_simulator
from .request import (
    READABLE,
    FitRequest,
    FitTask,
    check_starts,
    is_unknown,
    make_task,
    make_unknowns,
    parameter_names,
    settable_names,
    span_remarks,
    variable_names,
)
from .result import FitResult

TRAJECTORY_FILE = "trajectory.csv"  # of a stored run


def make_tasks(request: FitRequest, own_notes: tuple[str, ...] = ()) -> tuple[FitTask, ...]:
    """Return the fit of each FMU of a request, the FMU of the request first, which has these notes.

    Raises
    ------
    SceneError
        If a name is unknown in all FMUs, if an FMU has none of the free parameters or lacks an observed output or an
        input, or if two FMUs are the same.
    """
    fmus = [request.run.fmu, *request.against]
    names = law_names(fmus)
    if len(fmus) == 1:
        return (replace(make_task(request), notes=own_notes),)
    descriptions = [read_description(fmu) for fmu in fmus]
    free = [parameter_names(description, request.observe) for description in descriptions]
    settable = [settable_names(description) for description in descriptions]
    check_names("parameter", request.free, {*chain.from_iterable(free)})
    check_names("parameter", request.run.values, {*chain.from_iterable(settable)})
    check_names("free parameter", request.each, [*request.free])
    check_starts(request)
    tasks: list[FitTask] = []
    for fmu, name, description, available, fixable in zip(fmus, names, descriptions, free, settable, strict=True):
        law = replace(
            request,
            run=replace(
                request.run,
                fmu=fmu,
                values={parameter: value for parameter, value in request.run.values.items() if parameter in fixable},
            ),
            name=name,
            against=(),
            free={parameter: limits for parameter, limits in request.free.items() if parameter in available},
            start={
                parameter: value
                for parameter, value in request.start.items()
                if is_unknown(parameter, available, available)
            },
            each=tuple(parameter for parameter in request.each if parameter in available),
        )
        for kind, causalities, headings in (
            ("output", READABLE, request.observe),
            ("input", ("input",), request.inputs),
        ):
            check_names(f"{kind} of {name}", headings, variable_names(description, causalities))
        if request.free and not law.free:
            raise SceneError(
                f"{name} has none of the free parameters {', '.join(request.free)}: free some of its own as well, as "
                f"in {option_text('free', [*request.free, *available[:1]])}"
            )
        missing_names = [
            parameter
            for parameter in (*request.free, *request.run.values)
            if parameter not in available and parameter not in fixable
        ]
        notes = (f"{name} has no {', '.join(missing_names)}: its fit leaves them out.",) if missing_names else ()
        try:
            tasks.append(replace(make_task(law), notes=notes if tasks else own_notes + notes))
        except SceneError as error:
            raise SceneError(f"{name}: {error}") from None
    for name in request.sigma:
        units = {task.variables[name].unit or "1" for task in tasks}
        if len(units) > 1:
            problem = f"{option_text('sigma')} of {name} has no single unit"
            raise SceneError(f"{problem}: it is in {' and '.join(sorted(units))}; leave it out")
    return tuple(tasks)


def law_names(fmus: list[Path]) -> list[str]:
    """Return a distinct name for each FMU; raise SceneError if one occurs twice."""
    paths = [fmu.resolve() for fmu in fmus]
    for i, path in enumerate(paths):
        if path in paths[:i]:
            raise SceneError(f"{fmus[i].stem} is to be compared with itself: give another FMU")
    stems = [fmu.stem for fmu in fmus]
    names = [
        stem if stems.count(stem) == 1 else f"{path.parent.name}/{stem}"
        for stem, path in zip(stems, paths, strict=True)
    ]
    return [
        name if names.count(name) == 1 else str(path.with_suffix("")) for name, path in zip(names, paths, strict=True)
    ]


def load_existing(source: str, options: ColumnOptions) -> Record:
    """Load the record in a file, of a stored run with its parameters; SceneError if there is none."""
    if source != "-" and not exists(source):
        raise SceneError(f"{format_value(source)} does not exist: give an existing record")
    record = load_record(source, options)
    if basename(source) != TRAJECTORY_FILE:
        return record
    parameters = load_provenance(Path(source).parent).get("parameters", {})
    return replace(record, parameters={name: parameter["value"] for name, parameter in parameters.items()})


def fit_laws(
    tasks: Sequence[FitTask],
    records: Sequence[Record],
    validation: Sequence[Record],
    report: Callable[[float], None],
) -> FitResult:
    """Fit an FMU, and the FMUs to compare it with, to the same records, and predict the validation records.

    All fits use the same samples: if one of them cannot use means of neighbouring samples, none of them does.
    """
    count, fits = len(tasks), []

    def fit_law(i: int, averages: bool) -> ParameterFit:
        task = tasks[i]
        data, others = (
            [replace(record.signals(task.sources), sigma=task.request.sigma) for record in group]
            for group in (records, validation)
        )
        try:
            fit = fit_samples(task, data, lambda share: report((i + share) / count), averages, others)
        except HarnessError as error:
            if count > 1:
                error.args = (f"{task.name}: {error}", *error.args[1:])
            raise
        return replace(fit, notes=(*fit.notes, *task.notes))

    fits = [fit_law(i, averages=True) for i in range(count)]
    if len({fit.n_samples for fit in fits}) > 1:
        most = max(fit.n_samples for fit in fits)
        fits = [fit if fit.n_samples == most else fit_law(i, averages=False) for i, fit in enumerate(fits)]
    if count == 1:
        return FitResult(**vars(fits[0]))
    comparison = compare_laws(fits)
    is_worse = comparison.is_clear and comparison.laws[0].fmu != fits[0].fmu
    remarks = (*fits[0].remarks, comparison.verdict) if is_worse else fits[0].remarks
    others = tuple(convert_outputs(fit, fits[0]) for fit in fits[1:])
    return FitResult(**vars(replace(fits[0], remarks=remarks, against=others, comparison=comparison)))


def convert_outputs(fit: ParameterFit, target: ParameterFit) -> ParameterFit:
    """Return a fit with its outputs in the units of another fit to the same records."""
    columns = convert_columns(fit.columns, target.columns)
    outputs = fit.predictions[0].shape[1]
    factors = [
        target_column.noise / column.noise for column, target_column in zip(fit.columns, target.columns, strict=True)
    ][:outputs]
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
        replace(target, residual=column.residual * (target.noise / column.noise))
        for column, target in zip(columns, targets, strict=True)
    )


def fit_samples(
    task: FitTask,
    data: Sequence[Samples],
    report: Callable[[float], None],
    averages: bool = True,
    validation: Sequence[Samples] = (),
) -> ParameterFit:
    """Fit the parameters of an FMU to samples.

    Parameters
    ----------
    averages : bool
        Whether long records may be fitted as means of neighbouring samples.
    validation : sequence of Samples
        Records that are predicted, but not fitted.

    Raises
    ------
    SceneError
        If the request does not fit the records.
    HarnessError
        If the fit fails.
    """
    request, start_time = task.request, process_time()
    if validation and request.each and len(data) > 1:
        raise SceneError(
            f"{', '.join(request.each)} has a value of its own for each record, and none for the validation record: "
            f"leave out {option_text('each')} or {option_text('validate')}"
        )
    units = {name: task.variables[name].unit for name in request.observe}
    slips = irregular_slips(data, [*units.items()])
    unknowns, doubts = make_unknowns(task, data), [*span_remarks(task, data)]
    with (
        open_simulator(replace(task.shared_run, fmu=native_equivalent(request.run.fmu))) as simulator,
        closing(DerivativeRuns(simulator.spec)) as derivatives,
    ):
        try:
            problem, raw_fit = fit_records(
                simulator, data, unknowns, task.fixed_values, request.robust, report, averages, derivatives
            )
        except HarnessError as error:
            remarks = [*doubts, *(item.remark for item in slips)]
            raise HarnessError(". ".join([str(error), *remarks]).removesuffix(".")) from None
        prediction = validate(problem, raw_fit, validation) if validation else None
        notes = [note for samples in (*data, *validation) for note in samples.notes]
        n_runs = simulator.n_runs + derivatives.n_runs
        fit = describe_fit(task.name, problem, raw_fit, notes, n_runs, process_time() - start_time)
    curves = read_tables_with(request.run.fmu, [estimate.name for estimate in fit.estimates], request.run.values)
    rough = {(column.record, column.name) for column in fit.columns if column.residual > ROUGH * column.noise}
    slips = tuple(item for item in slips if (item.record, item.column) in rough)  # an input may explain the others
    others = [*doubts, *(item.remark for item in slips)]
    remarks = [*others, *fit.remarks] if fit.describes_record else [*fit.remarks, *others]
    fit = replace(fit, columns=set_units(fit.columns, units), remarks=tuple(remarks), slips=slips, tables=curves)
    if prediction:
        prediction = replace(prediction, columns=set_units(prediction.columns, units))
        fit = replace(fit, validation=prediction, remarks=(*fit.remarks, *prediction.remarks))
    return fit


def set_units(columns: Sequence[ColumnResiduals], units: Mapping[str, str]) -> tuple[ColumnResiduals, ...]:
    """Return columns with the units of their variables."""
    return tuple(replace(column, unit=units[column.name]) for column in columns)
