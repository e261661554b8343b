"""Request of a fit: parsed from options, and checked against the FMU and the record.

It holds unknowns, fixed values, observed variables and inputs; where the user observes none, they are chosen here.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from ...analyses.fit.unknowns import DELAY, GAIN, OFFSET, RANGE_FACTOR, SENSOR, Unknown
from ...errors import SceneError, check_names, format_value, option_text
from ...records.columns import Column, find_column, find_time_column, list_columns
from ...records.extraction import Samples
from ...records.motion import MIN_SAMPLES
from ...records.record import Record, SignalSource
from ...records.units import conversion_factor
from ...scenes.assignments import parse_assignments
from ...scenes.roles import ROLES, find_roles
from ...scenes.run_spec import RunSpec
from ...simulation.fmu_archive import default_stop, read_description
from ...simulation.model_data import read_model_data
from ...simulation.variable_values import convert_value, effective_value, enumeration_labels
from ...simulation.whole_run import RealVariable, real_variables

SAMPLES_PER_UNKNOWN = 4
GAIN_RANGE = (0.5, 2.0)
SPAN_RATIO = 4.0  # about a factor of a thousand between a record and a run of the FMU: its times have another unit
DELAY_SHARE = 0.1  # of the duration of the shortest record: default range of a delay
SOLVER = "solver."  # beginning of the names of the settings of a solver
READABLE = ("output", "local")  # causalities of variables that can be observed
TOLERANCE, SOLVER_RTOL = 1e-8, "solver.rtol"  # larger tolerances make the derivatives of residuals inaccurate
# at this tolerance, dop853 takes half of the time of ode45, and ode23 takes longer than ode45
METHOD, SOLVER_METHOD, SLOWER_METHODS = "dop853", "solver.method", ("ode23", "ode45")

Range = tuple[float, float] | None


@dataclass(frozen=True)
class FitRequest:
    """Request of a fit by a user.

    Attributes
    ----------
    run : RunSpec
        The FMU, the values of other variables, and as `timeout` the seconds of processor time that one run may take.
    free : mapping
        Range to search of each unknown, None for the default. ``offset(x)``, ``gain(x)`` and ``delay(x)`` are unknowns
        of the sensor of an observed variable.
    observe, inputs : mapping
        Headings of the columns of observed variables and of inputs, by variable.
    sigma : mapping
        Known standard deviations of the noise, by observed variable, in the units of the FMU.
    start : mapping
        Values to start from, by free parameter; for one record of several, by a name as in ``x0[1]``.
    each : tuple of str
        Unknowns that have a separate value for each record.
    robust : bool
        Whether large residuals count linearly instead of by their squares.
    against : tuple of pathlib.Path
        Other FMUs to fit to the same records.
    name : str
        Name of the FMU in results; by default that of its file.
    """

    run: RunSpec
    free: Mapping[str, Range]
    observe: Mapping[str, str]
    inputs: Mapping[str, str] = field(default_factory=dict)
    sigma: Mapping[str, float] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    each: tuple[str, ...] = ()
    robust: bool = False
    against: tuple[Path, ...] = ()
    name: str = ""


@dataclass(frozen=True)
class FitTask:
    """Fit of one FMU: a request that has been checked against its variables.

    Attributes
    ----------
    request : FitRequest
        The request.
    variables : mapping
        The scalar Reals of the FMU.
    sources : mapping
        Columns of all signals, by variable.
    fixed_values : mapping
        Values of Reals that are not fitted.
    shared_run : RunSpec
        Settings that all runs of the fit share: the observed outputs, and values that are not Reals.
    notes : tuple of str
        Assumptions on which names the FMU has.
    """

    request: FitRequest
    variables: Mapping[str, RealVariable]
    sources: Mapping[str, SignalSource]
    fixed_values: Mapping[str, float]
    shared_run: RunSpec
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Return the name of the FMU in results."""
        return self.request.name or self.request.run.model


def make_task(request: FitRequest) -> FitTask:
    """Check a request against the variables of the FMU.

    Raises
    ------
    SceneError
        If a name, a value or a range does not fit.
    """
    description = read_description(request.run.fmu)
    variables = real_variables(description)
    parameters = parameter_names(description, request.observe)
    inputs = variable_names(description, ("input",))
    readable = variable_names(description, READABLE)
    if not request.free:
        raise SceneError(f"nothing is free: name the parameters to fit, as in {option_text('free', parameters[:2])}")
    if not request.observe:
        example = option_text("observe", {readable[0]: "position"})
        raise SceneError(f"nothing is observed: name a variable and its column, as in {example}")
    check_names("output", request.observe, readable)
    check_names("input", request.inputs, inputs)
    check_names("parameter", request.free, parameters)
    check_names("observed variable", request.sigma, [*request.observe])
    check_names("free parameter", request.each, [*request.free])
    check_starts(request)
    declared_variables = {variable.name: variable for variable in description.modelVariables}
    check_names("parameter", request.run.values, settable_names(description))
    for name in request.run.values:
        if name in request.free or name in request.inputs:
            raise SceneError(
                f"{name} is fixed, and {'free' if name in request.free else 'driven by a column'}: remove one"
            )
    for name, value in request.sigma.items():
        if not (isfinite(value) and value > 0):
            raise SceneError(f"sigma of {name} is {value!r}: it must be a finite number above 0")
    values = {name: convert_value(declared_variables[name], value) for name, value in request.run.values.items()}
    values = solver_settings(declared_variables) | values
    return FitTask(
        request,
        variables,
        {
            name: SignalSource(heading, variables[name].unit, is_input)
            for signals, is_input in ((request.observe, False), (request.inputs, True))
            for name, heading in signals.items()
        },
        {name: value for name, value in values.items() if name in variables},
        replace(
            request.run,
            outputs=tuple(request.observe),
            follow=False,
            values={name: value for name, value in values.items() if name not in variables},
        ),
    )


def solver_settings(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tolerance of the solver, and its method if the default one is slow at this tolerance."""
    if SOLVER_RTOL not in variables:
        return {}
    settings: dict[str, Any] = {SOLVER_RTOL: TOLERANCE}
    if SOLVER_METHOD in variables:
        variable = variables[SOLVER_METHOD]
        labels = enumeration_labels(variable)
        if METHOD in labels.values() and labels.get(int(variable.start)) in SLOWER_METHODS:
            settings[SOLVER_METHOD] = convert_value(variable, METHOD)
    return settings


def is_unknown(name: str, free: Iterable[str], per_record: Iterable[str]) -> bool:
    """Return whether a name is that of an unknown: a free parameter, or its value in one record, as in x0[1]."""
    return name in free or (name.endswith("]") and name.rpartition("[")[0] in per_record)


def check_starts(request: FitRequest) -> None:
    """Raise SceneError if a value to start from is not that of an unknown."""
    check_names(
        "free parameter",
        [name for name in request.start if not is_unknown(name, request.free, request.each)],
        [*request.free],
    )


def variable_names(description: Any, causalities: Sequence[str]) -> list[str]:
    """Return the names of the scalar Reals of an FMU with one of the causalities."""
    return [name for name, variable in real_variables(description).items() if variable.causality in causalities]


def parameter_names(description: Any, observe: Iterable[str]) -> list[str]:
    """Return the names that can be free: Real parameters of the FMU, and offset, gain and delay of each sensor."""
    parameters = variable_names(description, ("parameter",))
    return [*parameters, *(f"{kind}({name})" for name in observe for kind in SENSOR)]


def settable_names(description: Any) -> list[str]:
    """Return the names of the parameters and inputs of an FMU."""
    return [variable.name for variable in description.modelVariables if variable.causality in ("parameter", "input")]


def make_unknowns(task: FitTask, records: Sequence[Samples]) -> tuple[Unknown, ...]:
    """Return the unknowns; one with a separate value for each record occurs once per record, named as in x0[1]."""
    request, unknowns = task.request, []
    for name, limits in request.free.items():
        start = request.start.get(name)
        if name in request.each and len(records) > 1:
            for i in range(len(records)):
                indexed_name = f"{name}[{i + 1}]"
                unknown = make_unknown(name, limits, request.start.get(indexed_name, start), task, records)
                unknowns.append(replace(unknown, name=indexed_name, record=i))
        else:
            unknowns.append(make_unknown(name, limits, start, task, records))
    samples = sum(record.y.size for record in records)
    if samples < max(MIN_SAMPLES, SAMPLES_PER_UNKNOWN * len(unknowns)):
        raise SceneError(
            f"{len(unknowns)} unknowns need at least {SAMPLES_PER_UNKNOWN * len(unknowns)} samples, and there are "
            f"{samples}: give a longer record, or fix some"
        )
    return tuple(unknowns)


def make_unknown(name: str, limits: Range, start: float | None, task: FitTask, records: Sequence[Samples]) -> Unknown:
    """Return an unknown with the range to search; raise SceneError if the range is not valid."""
    observed = [*task.request.observe]
    kind, _, argument = name.partition("(")
    if argument and argument.removesuffix(")") in observed:
        column = observed.index(argument.removesuffix(")"))
        size = max(float(np.ptp(record.y[:, column])) for record in records)
        duration = min(float(record.t[-1] - record.t[0]) for record in records)
        low, high = limits or {OFFSET: (-size, size), GAIN: GAIN_RANGE, DELAY: (0.0, DELAY_SHARE * duration)}[kind]
        unit = {OFFSET: task.variables[observed[column]].unit, GAIN: "", DELAY: "s"}[kind]
        check_range(name, low, high, -inf, inf, unit)
        if kind == DELAY and max(abs(low), abs(high)) >= duration:
            raise SceneError(
                f"{name} = {format_value(low)}:{format_value(high)} reaches beyond the record, which lasts "
                f"{duration:.4g} s: give a shorter range"
            )
        check_start(name, start, low, high)
        return Unknown(name, kind, unit, low, high, column=column, start=start)
    variable = task.variables[name]
    minimum = -inf if variable.minimum is None else variable.minimum
    maximum = inf if variable.maximum is None else variable.maximum
    size = table_size(name, task.request) if limits is None else 0.0
    if size:
        low, high = max(-RANGE_FACTOR * size, minimum), min(RANGE_FACTOR * size, maximum)
    elif limits is None:
        middle = start if start is not None else variable.start
        if not middle:
            example = option_text("free", {name: (max(minimum, -1.0), min(maximum, 1.0))})
            raise SceneError(f"{name} has no start value other than 0: give the range to search, as in {example}")
        low, high = sorted((middle / RANGE_FACTOR, middle * RANGE_FACTOR))
        low, high = max(low, minimum), min(high, maximum)
    else:
        low, high = limits
    check_range(name, low, high, minimum, maximum, variable.unit)
    check_start(name, start, low, high)
    is_tunable = variable.variability == "tunable"
    return Unknown(name, name, variable.unit, low, high, minimum, maximum, start=start, is_tunable=is_tunable)


def table_size(name: str, request: FitRequest) -> float:
    """Return the largest value at the start of the table that a parameter belongs to; 0 if it belongs to none.

    It is the scale that all values of a table share, so that one of them may start at zero and change its sign.
    """
    tables = [table for table in read_model_data(request.run.fmu).tables if name in table.parameters]
    return max((abs(y) for table in tables for y in table.y_with({**request.run.values, **request.start})), default=0.0)


def check_start(name: str, start: float | None, low: float, high: float) -> None:
    """Raise SceneError if a start value is outside the range to search."""
    if start is not None and not low <= start <= high:
        raise SceneError(f"the start value {start!r} of {name} is outside its range, {low!r} to {high!r}")


def check_range(name: str, low: float, high: float, minimum: float, maximum: float, unit: str) -> None:
    """Raise SceneError if a range is empty or exceeds the limits of the FMU."""
    text = f"{name} = {format_value(low)}:{format_value(high)}"
    if not (isfinite(low) and isfinite(high) and low < high):
        raise SceneError(f"{text} is not a range: give two finite numbers, the smaller one first")
    if low < minimum or high > maximum:
        bounds = [f"at least {minimum!r}"] * (minimum > -inf) + [f"at most {maximum!r}"] * (maximum < inf)
        raise SceneError(f"{text} is outside the range of the FMU; allowed: {' and '.join(bounds)} {unit}".rstrip())


def span_remarks(task: FitTask, records: Sequence[Samples]) -> Iterator[str]:
    """Yield a remark on each record that lasts about a thousand times as long as a run of the FMU, or a thousandth."""
    stop = default_stop(read_description(task.request.run.fmu))
    for record in records:
        duration = float(record.t[-1] - record.t[0])
        ratio = duration / stop if stop else 1.0
        for factor, comparison, unit in (
            (1000.0, "a thousand times as long as", "ms"),
            (0.001, "a thousandth of", "s"),
        ):
            if 1 / SPAN_RATIO < ratio / factor < SPAN_RATIO:
                yield (
                    f"{record.name} lasts {duration:.4g} s, about {comparison} a run of the FMU ({stop:g} s): if its "
                    f"times are in {unit}, state that in their heading, as in t [{unit}], or by "
                    f"{option_text('time', f't [{unit}]')}."
                )


def split_list(texts: Iterable[str]) -> list[str]:
    """Return the items of comma-separated lists."""
    return [item.strip() for text in texts for item in text.split(",") if item.strip()]


def parse_ranges(texts: Iterable[str]) -> dict[str, tuple[float, float] | None]:
    """Return the range of each name, as in "mu_s,mu_d=0.1:2"; None without a range."""
    ranges: dict[str, tuple[float, float] | None] = {}
    for item in split_list(texts):
        name, separator, limits = (part.strip() for part in item.partition("="))
        if name in ranges:
            raise SceneError(f"--free names {name} twice: remove one")
        low, colon, high = limits.partition(":")
        if separator and not colon:
            raise SceneError(f"--free {item}: give a range, as in {name}=0.1:2, or fix it by --set {item}")
        ranges[name] = (parse_number("--free", item, low), parse_number("--free", item, high)) if separator else None
    return ranges


def parse_numbers(option: str, texts: Iterable[str]) -> dict[str, float]:
    """Return the numbers of assignments, as in "k=800,m=3"."""
    return {
        name: parse_number(option, f"{name}={value}", str(value))
        for name, value in parse_assignments(option, texts).items()
    }


def parse_starts(texts: Iterable[str], free: Iterable[str], per_record: Iterable[str]) -> dict[str, float]:
    """Return the values to start from: assignments, and the values of stored fits that are free again."""
    starts: dict[str, float] = {}
    assignments = []
    for text in texts:
        path = Path(text)
        if path.is_dir() or path.suffix == ".json":
            starts |= select_starts(read_fitted_values(path), free, per_record)
        else:
            assignments.append(text)
    return starts | parse_numbers("--start", assignments)


def select_starts(values: Mapping[str, float], free: Iterable[str], per_record: Iterable[str]) -> dict[str, float]:
    """Return those values of an earlier fit that are free again."""
    return {name: value for name, value in values.items() if is_unknown(name, free, per_record)}


def read_fitted_values(path: Path) -> dict[str, float]:
    """Return the values of a stored fit by name, from its folder or its fit.json.

    Raises
    ------
    SceneError
        If there is no fit.
    """
    file = path / "fit.json" if path.is_dir() else path
    try:
        estimates = json.loads(file.read_text(encoding="utf-8"))["fit"]
        return {estimate["name"]: float(estimate["value"]) for estimate in estimates if estimate["value"] is not None}
    except (OSError, ValueError, KeyError, TypeError):
        raise SceneError(f"{path} holds no result of a fit: name its folder or its fit.json") from None


def parse_number(option: str, item: str, text: str) -> float:
    """Return a finite number; raise SceneError if the text is none."""
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if not isfinite(number):
        raise SceneError(f"{option} {item}: {format_value(text)} is not a finite number")
    return number


def parse_columns(option: str, texts: Iterable[str]) -> dict[str, str]:
    """Return the heading of each variable, as in "x=position"; the name of the variable without a heading."""
    columns = {}
    for text in texts:
        name, _, heading = text.partition("=")
        if not name.strip():
            raise SceneError(f"{option} {format_value(text)} names no variable; write it as in x=position")
        columns[name.strip()] = heading.strip() or name.strip()
    return columns


def choose_columns(request: FitRequest, records: Sequence[Record]) -> tuple[FitRequest, tuple[str, ...]]:
    """Return a request that observes outputs and names the inputs of the records, and a sentence on each choice.

    Raises
    ------
    SceneError
        If no output is named, and no column is that of an output.
    """
    request, input_sentence = choose_inputs(request, records)
    request, output_sentence = choose_observed(request, records[0])
    request, value_sentence = fix_run_values(request, records)
    return request, tuple(filter(None, (output_sentence, input_sentence, value_sentence)))


def fix_run_values(request: FitRequest, records: Sequence[Record]) -> tuple[FitRequest, str]:
    """Return a request that fixes the parameters in which the runs of the records differ from the FMU, and a sentence.

    These are no settings of the solver. The sentence is empty without any, as for measured records.

    Raises
    ------
    SceneError
        If a parameter has several values in the runs.
    """
    values: dict[str, Any] = {}
    for variable in read_description(request.run.fmu).modelVariables:
        name = variable.name
        if variable.causality != "parameter" or name.startswith(SOLVER) or name in (*request.free, *request.run.values):
            continue
        record_values = [*dict.fromkeys(record.parameters[name] for record in records if name in record.parameters)]
        if len(record_values) > 1:
            pair = f"{record_values[0]} and {record_values[1]}"
            raise SceneError(
                f"the runs of the records differ in {name}, {pair}: free it, and name it in {option_text('each')}"
            )
        if record_values and record_values[0] != effective_value(variable, variable.start):
            values[name] = record_values[0]
    if not values:
        return request, ""
    settings = ", ".join(f"{name} = {value}" for name, value in values.items())
    run = replace(request.run, values=values | dict(request.run.values))
    sentence = f"{settings}, as in the run of the record; {option_text('values')} sets other values."
    return replace(request, run=run), sentence


def choose_inputs(request: FitRequest, records: Sequence[Record]) -> tuple[FitRequest, str]:
    """Return a request with the columns that are named like inputs of all FMUs, and a sentence; empty without any.

    All records must have the column, because the same headings apply to all.
    """
    if request.inputs:
        return request, ""
    inputs = set.intersection(
        *(
            {name for name, variable in real_variables(read_description(fmu)).items() if variable.causality == "input"}
            for fmu in (request.run.fmu, *request.against)
        )
    )
    headings = [
        {column.name: column.heading for column in list_columns(record.table) if column.name in inputs}
        for record in records
    ]
    input_headings = {
        name: heading for name, heading in headings[0].items() if all(name in others for others in headings[1:])
    }
    if not input_headings:
        return request, ""
    names = ", ".join(input_headings)
    columns = "the record has columns of these names" if len(input_headings) > 1 else "a column has its name"
    sentence = f"the runs are driven by {names}, because {columns}; {option_text('inputs')} selects others."
    return replace(request, inputs=input_headings), sentence


def choose_observed(request: FitRequest, record: Record) -> tuple[FitRequest, str]:
    """Return a request that observes outputs, and a sentence on the choice; empty if the request names outputs.

    A column that is named like an output is taken: of several, the position, the velocity, the acceleration or the
    first. Otherwise it is the only column whose unit fits one output only.

    Raises
    ------
    SceneError
        If there is no such column.
    """
    if request.observe:
        return request, ""
    table, options = record.table, record.options
    candidates = list_columns(table)
    time_column = find_time_column(table, candidates, options)
    if options.column is not None:  # the record names its signal
        column = find_column(options.column, table, candidates)
        candidates = [replace(column, unit=options.unit or column.unit)]
    input_headings = {heading.lower() for heading in request.inputs.values()}
    columns = [
        column
        for column in candidates
        if column is not time_column and not {column.name.lower(), column.heading.lower()} & input_headings
    ]
    description = read_description(request.run.fmu)
    outputs = {
        name: variable.unit for name, variable in real_variables(description).items() if variable.causality == "output"
    }
    output_columns = {column.name: column for column in columns if column.name in outputs}
    if output_columns:
        roles = find_roles({variable.name: variable for variable in description.modelVariables})
        output = next((roles[role] for role in ROLES if roles.get(role) in output_columns), next(iter(output_columns)))
        others = ", ".join(name for name in output_columns if name != output)
        return replace(request, observe={output: output_columns[output].heading}), (
            f"{output} is observed, because a column has its name{f', and {others} not' if others else ''}; "
            f"{option_text('observe')} selects other outputs."
        )
    fits = list(fit_units(columns, outputs))
    if len(fits) != 1:
        headings = ", ".join(column.heading for column in columns if column.heading)
        example = {fits[0][0] if fits else next(iter(outputs), "x"): (headings or "position").split(",")[0]}
        raise SceneError(
            f"nothing is observed: {table.name} has no column with the name of an output ({', '.join(outputs)}), and "
            f"{'several units fit' if fits else 'no unit fits'}; name an output and its column, as in "
            f"{option_text('observe', example)}"
        )
    ((output, column),) = fits
    return replace(request, observe={output: column.heading}), (
        f"{output} is observed in {column.heading}, the only column with a unit of this output; "
        f"{option_text('observe')} selects another."
    )


def fit_units(columns: list[Column], outputs: dict[str, str]) -> Iterator[tuple[str, Column]]:
    """Yield each output and column whose units measure the same quantity."""
    for output, unit in outputs.items():
        for column in columns:
            if column.unit and unit and conversion_factor(column.unit, unit) is not None:
                yield output, column
