"""Derivatives of the outputs of an FMU by parameters: checks the request, and runs the FMU."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import HarnessError, SceneError, check_names
from ...process.worker import WorkerDiedError, WorkerTimeoutError, call_once
from ...scenes.run_spec import RunSpec
from ...simulation.external.simulation import convert_values
from ...simulation.fmu_archive import is_own, read_description, resolve_time_span, unpack_once
from ...simulation.fmu_instance import capture_stderr
from ...simulation.model_data import read_model_data
from ...simulation.native_equivalent import check_has_events, native_with_derivatives
from ...simulation.session import resolve_settings
from ...simulation.stepping import TIME, check_inputs, check_rates
from ...simulation.variable_values import REAL_TYPES, effective_value, variable_unit
from ...simulation.variational import DEFAULT_RTOL, differentiate, state_variables
from ...simulation.variational_solution import VariationalSolution
from .result import SensitivityEvent, SensitivityResult

DEFAULT_POINTS = 1001  # recorded times


def compute_sensitivity(
    spec: RunSpec, parameters: Sequence[str], report: Callable[[float], None] = lambda share: None
) -> SensitivityResult:
    """Run an FMU with the derivatives of its outputs by parameters.

    Parameters
    ----------
    spec : RunSpec
        The run; its `tolerance` is that of the integration.
    parameters : sequence of str
        Parameters, inputs, or states whose start values can be set.
    report : callable
        Receives the progress from 0 to 1.

    Raises
    ------
    SceneError
        If a name, a value or a time is not valid.
    HarnessError
        If the FMU has no directional derivatives, or the run fails.
    """
    source, spec = spec, replace(spec, fmu=native_with_derivatives(spec.fmu))
    description = read_description(spec.fmu, spec.lenient)
    variables = {variable.name: variable for variable in description.modelVariables}
    start, stop = resolve_time_span(spec, description)
    times = np.asarray(spec.times, dtype=float) if len(spec.times) else np.linspace(start, stop, DEFAULT_POINTS)
    for t in times[[0, -1]].tolist():
        if not start <= t <= stop:
            raise SceneError(f"times has {t!r} s, outside the run from {start!r} s to {stop!r} s")
    check_inputs(spec.inputs, variables, spec.values)
    check_rates(spec.fmu, spec.inputs, spec.values)
    outputs = choose_outputs(description, parameters, spec.outputs)
    if is_own(description):
        values = {variable.name: value for variable, value in resolve_settings(spec, variables)}
        check_has_events(spec.fmu, variables, values)
    else:
        values = convert_values(spec, variables)
    tolerance = spec.tolerance or DEFAULT_RTOL
    run = replace(spec, outputs=outputs, values=values, times=times, start=start, stop=stop, tolerance=tolerance)
    solution = run_isolated(run, tuple(parameters), is_own(description), report)
    input_names = [name for name in parameters if name in spec.inputs]
    effective = {name: float(values.get(name, variables[name].start or 0.0)) for name in parameters}
    units = {name: variable_unit(variables[name]) for name in (*outputs, *parameters)}
    return SensitivityResult(
        replace(source, outputs=outputs, times=(), start=start, stop=stop),
        times,
        outputs,
        effective | dict.fromkeys(input_names, 1.0),
        units | dict.fromkeys(input_names, ""),
        solution.values,
        solution.left,
        solution.right,
        describe_events(spec.fmu, solution, parameters),
        describe_exceptions(spec.fmu, solution, parameters),
        {
            variable.name: effective_value(variable, values.get(variable.name, variable.start))
            for variable in description.modelVariables
            if variable.causality == "parameter"
        },
    )


def choose_outputs(description: Any, parameters: Sequence[str], outputs: Sequence[str]) -> tuple[str, ...]:
    """Check the names of parameters and outputs; return the outputs, all Reals by default."""
    states = [state.name for state in state_variables(description)]
    reals = [item for item in description.modelVariables if item.type in REAL_TYPES and not item.dimensions]
    starts = {item.name for item in reals if item.name in states and item.initial == "exact"}
    settable_names = {item.name for item in reals if item.causality in ("parameter", "input") and item.name != TIME}
    check_names("parameter", parameters, settable_names | starts)
    output_names = [item.name for item in reals if item.causality == "output"]
    check_names("output", outputs, [*output_names, *(name for name in states if name not in output_names)])
    return tuple(outputs or output_names)


def run_isolated(
    spec: RunSpec, parameters: tuple[str, ...], is_own_fmu: bool, report: Callable[[float], None]
) -> VariationalSolution:
    """Run an FMU of this project in this process, any other in a worker process."""
    folder = unpack_once(spec.fmu)
    if is_own_fmu:
        with capture_stderr() as stderr:
            return differentiate(spec, folder, parameters, stderr, report)
    try:
        solution: VariationalSolution = call_once(differentiate, spec, folder, parameters, timeout=spec.timeout)
    except WorkerTimeoutError:
        raise HarnessError(f"{spec.fmu.name}: the run took longer than {spec.timeout:g} s") from None
    except WorkerDiedError as error:
        raise HarnessError(f"{spec.fmu.name}: its binary exited with status {error.status}") from None
    return solution


def describe_events(
    fmu: Path, solution: VariationalSolution, parameters: Sequence[str]
) -> tuple[SensitivityEvent, ...]:
    """Return the events with the names of their contacts.

    Events of a contact that change no mode are left out: one in a plane has them where the solver restarts.
    """
    contacts = list(read_model_data(fmu).contacts)
    return tuple(
        SensitivityEvent(
            event.t,
            name_indicator(contacts, event.indicator),
            dict(zip(contacts, event.before, strict=True)),
            dict(zip(contacts, event.after, strict=True)),
            dict(zip(parameters, event.slopes.tolist(), strict=True)),
        )
        for event in solution.events
        if event.before != event.after or not 0 <= event.indicator < 2 * len(contacts)
    )


def name_indicator(contacts: Sequence[str], indicator: int) -> str:
    """Return the contact of an event indicator, or its number; FMUs of this project have two for each contact."""
    count = len(contacts)
    if 0 <= indicator < 2 * count:
        return contacts[indicator % count]
    return f"condition {indicator - 2 * count + 1}" if count else f"event indicator {indicator + 1}"


def describe_exceptions(fmu: Path, solution: VariationalSolution, parameters: Sequence[str]) -> tuple[str, ...]:
    """Return sentences on parameters without an effect, and on times without derivatives."""
    unused_names = [name for name, is_used in zip(parameters, solution.is_used, strict=True) if not is_used]
    remarks = [f"Nothing depends on {', '.join(unused_names)}: all derivatives are zero."] if unused_names else []
    contacts = list(read_model_data(fmu).contacts)
    for item in solution.undefined_derivatives:
        where, names = "at" if item.is_moment else "from", ", ".join(item.parameters)
        name = f" ({name_indicator(contacts, item.indicator)})" if item.indicator >= 0 else ""
        remarks.append(f"No derivative by {names} {where} t = {item.t:.9g} s: {item.reason}{name}.")
    return tuple(remarks)
