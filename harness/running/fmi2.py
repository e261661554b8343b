"""Runs FMI 2.0 FMUs of this project through fmpy.

The solver of the FMU does not depend on the communication points. A step to `solver.t_next` ends where an internal step
ends, so following it records every internal step and event through the standard interface.
"""

import io
import os
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stderr, suppress
from ctypes import byref, c_double, c_int, c_uint, c_void_p
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException as FMICallException  # re-exported for callers that step by themselves

from ..errors import HarnessError, SceneError, first_line
from ..scenes.run_spec import RunSpec
from .contacts import find_contacts
from .description import read_description, resolve_time_span
from .inputs import InputSignals, check_inputs
from .settings import check_fmu, resolve_settings
from .trajectory import ModeChanges, SolverSteps, Statistics, Trajectory
from .unpacking import unpack
from .variable_values import effective_value, enumeration_labels, variable_unit

ProgressCallback = Callable[[float], None]  # receives the progress of a run, from 0 to 1

WARNING, ERROR = 1, 3  # fmi2Status; any status above a warning is a failure
MAX_POINTS = 10_000_000  # of a grid
REPORT_INTERVAL = 4096  # communication points


@dataclass(frozen=True)
class RunPlan:
    """Resolved run: times in s, and the variables to read at each communication point."""

    spec: RunSpec
    variables: dict[str, Any]
    start: float
    stop: float
    reals: list[str]
    integers: list[str]


@dataclass(frozen=True)
class RecordedSamples:
    """Raw samples of one pass: time, one row of reals and of integers per communication point, and the rows at which
    internal steps end, start included.
    """

    time: "array[float]" = field(default_factory=lambda: array("d"))
    reals: "array[float]" = field(default_factory=lambda: array("d"))
    integers: "array[int]" = field(default_factory=lambda: array("i"))
    step_ends: "array[int]" = field(default_factory=lambda: array("q", [0]))


def simulate(spec: RunSpec, report: ProgressCallback = lambda share: None) -> Trajectory:
    """Run an FMU as specified.

    Parameters
    ----------
    spec : RunSpec
    report : callable
        Receives the progress of the run, from 0 to 1.

    Raises
    ------
    SceneError
        If the specification names variables or values that the FMU does not have.
    HarnessError
        If the run fails, with the message of the FMU.
    """
    with open_instance(spec) as (description, fmu, log):
        try:
            return run_repeats(plan_run(spec, description), fmu, report)
        except FMICallException as error:
            raise HarnessError(log.error_message or f"{spec.fmu.name}: {error}") from None


@dataclass(frozen=True)
class LogCapture:
    """Log messages of an FMU as (status, text), and its standard error."""

    messages: list[tuple[int, str]]
    stderr: io.StringIO

    @property
    def error_message(self) -> str:
        """Return the last message above a warning, or the last line on standard error; empty if there is neither."""
        logged = [text for status, text in self.messages if status > WARNING]
        return (logged or self.stderr.getvalue().strip().splitlines() or [""])[-1]

    def clear(self) -> None:
        """Discard all messages."""
        self.messages.clear()
        self.stderr.seek(self.stderr.truncate(0))


@contextmanager
def capture_stderr() -> Iterator[io.StringIO]:
    """Capture standard error of FMUs in Python and discard that of others.

    The log contains the same messages.
    """
    captured = io.StringIO()
    with ExitStack() as restore, redirect_stderr(captured):
        with suppress(OSError):  # there is no standard error
            saved = os.dup(2)
            restore.callback(os.close, saved)
            restore.callback(os.dup2, saved, 2)
            with open(os.devnull, "w") as null:
                os.dup2(null.fileno(), 2)
        yield captured


def read_own_description(spec: RunSpec) -> Any:
    """Return the model description of an FMU of this project.

    Raises
    ------
    HarnessError
        If it cannot be read or is not FMI 2.0 co-simulation.
    SceneError
        If the specification does not fit the FMU.
    """
    description = read_description(spec.fmu)
    if description.fmiVersion != "2.0" or description.coSimulation is None:
        raise HarnessError(f"{spec.fmu.name} is not an FMI 2.0 co-simulation FMU")
    check_fmu(spec, {variable.name: variable for variable in description.modelVariables})
    return description


@contextmanager
def open_instance(spec: RunSpec) -> Iterator[tuple[Any, Any, LogCapture]]:
    """Unpack and instantiate an FMU; yield its description, the instance and its log. Remove the files on exit."""
    description = read_own_description(spec)
    with unpack(spec.fmu) as folder, load_instance(spec, description, folder) as (fmu, log):
        yield description, fmu, log


@contextmanager
def load_instance(spec: RunSpec, description: Any, folder: Path) -> Iterator[tuple[Any, LogCapture]]:
    """Instantiate an unpacked FMU; yield the instance and its log. The files stay."""
    functions, messages = shared_callbacks()
    messages.clear()
    with capture_stderr() as stderr:
        try:
            fmu = fmi2.FMU2Slave(
                guid=description.guid,
                unzipDirectory=str(folder),
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=spec.model,
            )
            fmu.instantiate(callbacks=functions, loggingOn=True)
        except Exception as error:  # fmpy raises bare Exceptions
            raise HarnessError(f"{spec.fmu.name} cannot be loaded: {first_line(error)}") from None
        try:
            yield fmu, LogCapture(messages, stderr)
        finally:
            fmu.freeInstance()


@cache
def shared_callbacks() -> tuple[fmi2.fmi2CallbackFunctions, list[tuple[int, str]]]:
    """Return the FMI callbacks, and the list that collects log messages as (status, text).

    They are created once: fmpy's logger proxy always calls the logger that it was given last.
    """
    messages: list[tuple[int, str]] = []

    def log_message(environment: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        messages.append((status, text.decode("utf-8", "replace")))

    functions = fmi2.fmi2CallbackFunctions()
    functions.logger = fmi2.fmi2CallbackLoggerTYPE(log_message)
    functions.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
    functions.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
    fmi2.addLoggerProxy(byref(functions))
    return functions, messages


def plan_run(spec: RunSpec, description: Any) -> RunPlan:
    """Resolve times and variables of a run; add the variables that expose internal steps and events."""
    variables = {variable.name: variable for variable in description.modelVariables}
    start, stop = resolve_time_span(spec, description)
    check_inputs(spec.inputs, variables)
    if spec.grid is None and spec.equal_steps:
        spec = replace(spec, grid=(stop - start) / spec.equal_steps or None)
    if spec.grid is not None and (points := (stop - start) / spec.grid) > MAX_POINTS:
        sentence = f"grid = {spec.grid!r} s makes {points:.6g} points from {start!r} s to {stop!r} s"
        raise SceneError(f"{sentence}; the limit is {MAX_POINTS}: choose a larger grid")
    names = list(spec.outputs)
    if spec.follow:
        extra = (
            "solver.t_next",
            "solver.rejected",
            "events.count",
            "events.t_last",
            *find_contacts(variables).values(),
        )
        names += [name for name in extra if name in variables and name not in names]
    reals = [name for name in names if variables[name].type == "Real"]
    return RunPlan(spec, variables, start, stop, reals, [name for name in names if name not in reals])


def run_repeats(plan: RunPlan, fmu: Any, report: ProgressCallback) -> Trajectory:
    """Run the plan `repeat` times on one instance; return the last run with the fastest time."""
    repeat = plan.spec.repeat
    values = resolve_settings(plan.spec, plan.variables)
    stored = {variable.name: effective_value(variable, value) for variable, value in values}
    plan = replace(plan, spec=replace(plan.spec, values=stored))
    seconds = []
    for repeat_index in range(repeat):
        if repeat_index:
            fmu.reset()
        initialize(fmu, values, plan.start, plan.stop)
        started = perf_counter()
        trace = record_run(plan, fmu, report, repeat_index)
        seconds.append(perf_counter() - started)
    return build_trajectory(plan, fmu, trace, min(seconds))


def initialize(fmu: Any, values: Iterable[tuple[Any, float]], start: float, stop: float | None) -> None:
    """Set values and initialize an instance; times in s."""
    for variable, value in values:
        set_variable(fmu, variable, value)
    fmu.setupExperiment(startTime=start, stopTime=stop)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()


def set_variable(fmu: Any, variable: Any, value: float) -> None:
    """Set a real, integer or enumeration variable."""
    if variable.type == "Real":
        fmu.setReal([variable.valueReference], [value])
    else:
        fmu.setInteger([variable.valueReference], [int(value)])


def record_run(plan: RunPlan, fmu: Any, report: ProgressCallback, repeat_index: int) -> RecordedSamples:
    """Step from start to stop and record every communication point.

    The arrays and C functions are looked up once, because a step takes only microseconds.
    """
    component = c_void_p(fmu.component)
    do_step, get_real, get_integer = fmu.dll.fmi2DoStep, fmu.dll.fmi2GetReal, fmu.dll.fmi2GetInteger
    n_reals, real_references, reals = make_buffer(plan.variables, plan.reals, c_double)
    n_integers, integer_references, integers = make_buffer(plan.variables, plan.integers, c_int)
    trace = RecordedSamples()
    signals = input_signals(plan, fmu)
    row_of_reals, row_of_integers = memoryview(reals).cast("B"), memoryview(integers).cast("B")

    def record(t: float) -> None:
        if signals:
            signals.apply(t, after_event=True)
        if get_real(component, real_references, n_reals, reals) > WARNING:
            raise FMICallException("fmi2GetReal", ERROR)
        if n_integers and get_integer(component, integer_references, n_integers, integers) > WARNING:
            raise FMICallException("fmi2GetInteger", ERROR)
        trace.time.append(t)
        trace.reals.frombytes(row_of_reals)
        trace.integers.frombytes(row_of_integers)

    start, stop, grid, follow = plan.start, plan.stop, plan.spec.grid, plan.spec.follow
    next_at = plan.reals.index("solver.t_next") if follow else 0
    tolerance = 1e-9 * grid if grid else 0.0  # grid points this close to the end of a step coincide with it
    t, point, n_steps = start, 1, 0
    record(t)
    while t < stop:
        target, ends = stop, False
        if grid:
            while start + point * grid <= t + tolerance:
                point += 1
            if start + point * grid < stop - tolerance:
                target = start + point * grid
        if signals:
            target = min(target, signals.next_jump(t))
        # an input that was set at an event restarts the solver there, up to a rounding before it
        passed = signals is not None and reals[next_at] <= t + tolerance
        if follow and reals[next_at] <= target + tolerance and not passed:
            target, ends = min(reals[next_at], stop), True
        if not target > t:
            raise HarnessError(f"{plan.spec.fmu.name}: solver.t_next = {target!r} s is not after t = {t!r} s")
        if signals:
            signals.apply(0.5 * (t + target))
        status = do_step(component, t, target - t, 1)
        if status > WARNING:
            raise FMICallException("fmi2DoStep", status)
        t = target
        record(t)
        if ends:
            trace.step_ends.append(len(trace.time) - 1)
        n_steps += 1
        if n_steps % REPORT_INTERVAL == 0:
            report((repeat_index + (t - start) / (stop - start)) / plan.spec.repeat)
    return trace


def input_signals(plan: RunPlan, fmu: Any) -> InputSignals | None:
    """Return what sets the inputs of an instance, None if the run has no input signals."""
    inputs = plan.spec.inputs
    return InputSignals(inputs, fmu.setReal, plan.variables) if inputs else None


def make_buffer(variables: dict[str, Any], names: list[str], kind: Any) -> tuple[int, Any, Any]:
    """Return the number of variables, their value references and a buffer for their values."""
    n = len(names)
    return n, (c_uint * n)(*(variables[name].valueReference for name in names)), (kind * n)()


def build_trajectory(plan: RunPlan, fmu: Any, trace: RecordedSamples, seconds: float) -> Trajectory:
    """Build the trajectory of a run from its samples."""
    spec, variables = plan.spec, plan.variables
    time = np.array(trace.time)
    samples: dict[str, np.ndarray] = {}
    for names, values in ((plan.reals, trace.reals), (plan.integers, trace.integers)):
        samples |= zip(names, np.array(values).reshape(len(time), len(names)).T, strict=True)
    columns = {name: samples[name] for name in spec.outputs}
    for name, column in columns.items():
        invalid = np.flatnonzero(~np.isfinite(column))
        if len(invalid) and variables[name].causality == "output":
            raise HarnessError(f"{spec.fmu.name}: {name} is {column[invalid[0]]} at t = {time[invalid[0]]} s")
    steps = events = None
    if spec.follow:
        ends = np.array(trace.step_ends)
        steps = SolverSteps(time[ends], np.diff(time[ends]), np.diff(samples["solver.rejected"][ends]))
    effective = read_parameters(plan, fmu)
    if spec.follow and effective.get("friction") == "hybrid":
        at = np.flatnonzero(np.diff(samples["events.count"])) + 1
        rows = np.append(0, at)
        modes = {contact: samples[mode][rows] for contact, mode in find_contacts(variables).items()}
        events = ModeChanges(np.append(time[0], samples["events.t_last"][at]), modes)
    return Trajectory(
        spec=spec,
        time=time,
        columns=columns,
        units={name: variable_unit(variables[name]) for name in [*columns, *effective]},
        descriptions={name: variables[name].description or name for name in columns},
        parameters=effective,
        steps=steps,
        events=events,
        statistics=read_statistics(fmu, variables, seconds),
    )


def read_statistics(fmu: Any, variables: Mapping[str, Any], seconds: float) -> Statistics:
    """Return the counts of a run that has ended; `seconds` is its run time in s."""
    names = ("steps", "rejected", "evaluations")
    steps, rejected, evaluations = (read_integer(fmu, variables[f"solver.{name}"]) for name in names)
    if "events.count" not in variables:
        return Statistics(steps, rejected, evaluations, seconds)
    (last_event,) = fmu.getReal([variables["events.t_last"].valueReference])
    events = read_integer(fmu, variables["events.count"])
    return Statistics(steps, rejected, evaluations, seconds, events, last_event)


def read_parameters(plan: RunPlan, fmu: Any) -> dict[str, float | str]:
    """Return the value of every parameter: reals in SI units, enumerations by label."""
    values: dict[str, float | str] = {}
    for name, variable in plan.variables.items():
        if variable.causality == "parameter":
            if variable.type == "Enumeration":
                values[name] = enumeration_labels(variable)[read_integer(fmu, variable)]
            else:
                values[name] = fmu.getReal([variable.valueReference])[0]
    return values


def read_integer(fmu: Any, variable: Any) -> int:
    """Return the present value of an integer or enumeration."""
    return fmu.getInteger([variable.valueReference])[0]
