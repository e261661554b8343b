"""Runs a built FMI 2.0 FMU through fmpy, as it is wanted.

The FMU's solver runs free of the communication points.  A step to `solver.t_next` ends where the solver's own step
ends, so following it shows every step and event through the standard interface alone.
"""

import io
import os
from array import array
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, suppress
from ctypes import byref, c_double, c_int, c_uint, c_void_p
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException as FMICallException  # which those that run step by step catch

from ..errors import HarnessError, SceneError, first_line
from .description import read_description, resolve_time_span
from .inputs import InputSignals, check_inputs
from .run_spec import RunSpec
from .settings import check_fmu, resolve_settings
from .trajectory import ModeChanges, SolverSteps, Statistics, Trajectory
from .unpacking import unpack
from .variable_values import enumeration_labels, variable_unit

ProgressCallback = Callable[[float], None]  # told how far the run is, as a share of it

WARNING, ERROR = 1, 3  # fmi2Status; above a warning it is a failure
MAX_POINTS = 10_000_000  # of a grid
REPORT_INTERVAL = 4096  # communication points


@dataclass(frozen=True)
class RunPlan:
    """What a run does: from `start` to `stop` in s, and the variables read at each communication point."""

    spec: RunSpec
    variables: dict[str, Any]
    start: float
    stop: float
    reals: list[str]
    integers: list[str]


@dataclass(frozen=True)
class RecordedSamples:
    """What one pass leaves: time, a row of reals and of integers for each communication point, and the rows where an
    internal step ends (the start included)."""

    time: "array[float]" = field(default_factory=lambda: array("d"))
    reals: "array[float]" = field(default_factory=lambda: array("d"))
    integers: "array[int]" = field(default_factory=lambda: array("i"))
    step_ends: "array[int]" = field(default_factory=lambda: array("q", [0]))


def simulate(spec: RunSpec, report: ProgressCallback = lambda share: None) -> Trajectory:
    """The run that is wanted; HarnessError with the FMU's sentence if it fails, SceneError if it has not got that."""
    with open_instance(spec) as (found, fmu, heard):
        try:
            return run_repeats(plan_run(spec, found), fmu, report)
        except FMICallException as error:
            raise HarnessError(heard.error_message or f"{spec.fmu.name}: {error}") from None


@dataclass(frozen=True)
class LogCapture:
    """What an FMU says: `messages` of its log as (status, text), and what is `spoken` on standard error."""

    messages: list[tuple[int, str]]
    stderr: io.StringIO

    @property
    def error_message(self) -> str:
        """The last that is more than a warning; empty if it says nothing."""
        logged = [text for status, text in self.messages if status > WARNING]
        return (logged or self.stderr.getvalue().strip().splitlines() or [""])[-1]

    def clear(self) -> None:
        self.messages.clear()
        self.stderr.seek(self.stderr.truncate(0))


@contextmanager
def capture_stderr() -> Iterator[io.StringIO]:
    """What an FMU says on standard error is heard here alone, for the sentence stands in its log, too; one that is not
    in Python writes past Python, and to nobody."""
    spoken = io.StringIO()
    with ExitStack() as back, redirect_stderr(spoken):
        with suppress(OSError):  # there is none
            own = os.dup(2)
            back.callback(os.close, own)
            back.callback(os.dup2, own, 2)
            with open(os.devnull, "w") as nobody:
                os.dup2(nobody.fileno(), 2)
        yield spoken


def read_own_description(spec: RunSpec) -> Any:
    """What the FMU says of itself; HarnessError if it cannot be read, SceneError if it does not fit what is wanted."""
    found = read_description(spec.fmu)
    if found.fmiVersion != "2.0" or found.coSimulation is None:
        raise HarnessError(f"{spec.fmu.name} is not an FMI 2.0 co-simulation FMU")
    check_fmu(spec, {variable.name: variable for variable in found.modelVariables})
    return found


@contextmanager
def open_instance(spec: RunSpec) -> Iterator[tuple[Any, Any, LogCapture]]:
    """The description and a fresh instance of the FMU, and what it says; its files and its library are gone
    afterwards."""
    found = read_own_description(spec)
    with unpack(spec.fmu) as folder, load_instance(spec, found, folder) as (fmu, heard):
        yield found, fmu, heard


@contextmanager
def load_instance(spec: RunSpec, found: Any, folder: Path) -> Iterator[tuple[Any, LogCapture]]:
    """The same of an FMU so described, whose files are in a folder and stay there."""
    functions, messages = shared_callbacks()
    messages.clear()
    with capture_stderr() as spoken:
        try:
            fmu = fmi2.FMU2Slave(
                guid=found.guid,
                unzipDirectory=str(folder),
                modelIdentifier=found.coSimulation.modelIdentifier,
                instanceName=spec.model,
            )
            fmu.instantiate(callbacks=functions, loggingOn=True)
        except Exception as error:  # fmpy raises bare Exceptions
            raise HarnessError(f"{spec.fmu.name} cannot be loaded: {first_line(error)}") from None
        try:
            yield fmu, LogCapture(messages, spoken)
        finally:
            fmu.freeInstance()


@cache
def shared_callbacks() -> tuple[fmi2.fmi2CallbackFunctions, list[tuple[int, str]]]:
    """Callbacks, and the list to which their logger adds (status, text) of every message.

    Made once: fmpy's proxy, which fills in the arguments of a message, calls the last logger it was given, for ever.
    """
    messages: list[tuple[int, str]] = []

    def keep(environment: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        messages.append((status, text.decode("utf-8", "replace")))

    functions = fmi2.fmi2CallbackFunctions()
    functions.logger = fmi2.fmi2CallbackLoggerTYPE(keep)
    functions.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
    functions.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
    fmi2.addLoggerProxy(byref(functions))
    return functions, messages


def plan_run(spec: RunSpec, description: Any) -> RunPlan:
    """The plan of a run: what it names, and what follows the solver's steps."""
    variables = {variable.name: variable for variable in description.modelVariables}
    start, stop = resolve_time_span(spec, description)
    check_inputs(spec.inputs, variables)
    if spec.grid is None and spec.equal_steps:
        spec = replace(spec, grid=(stop - start) / spec.equal_steps or None)
    if spec.grid is not None and (points := (stop - start) / spec.grid) > MAX_POINTS:
        sentence = f"grid = {spec.grid!r} s makes {points:.6g} points from {start!r} s to {stop!r} s"
        raise SceneError(f"{sentence}; at most {MAX_POINTS}: take a larger one")
    names = list(spec.outputs)
    if spec.follow:
        extra = ("solver.t_next", "solver.rejected", "events.count", "events.t_last", find_mode_output(variables))
        names += [name for name in extra if name in variables and name not in names]
    reals = [name for name in names if variables[name].type == "Real"]
    return RunPlan(spec, variables, start, stop, reals, [name for name in names if name not in reals])


def find_mode_output(variables: dict[str, Any]) -> str:
    """The output that is the mode of friction, the only one that is an integer; empty where there is none."""
    return next((name for name, one in variables.items() if (one.causality, one.type) == ("output", "Integer")), "")


def run_repeats(plan: RunPlan, fmu: Any, report: ProgressCallback) -> Trajectory:
    """Run the plan as often as is asked, on one instance; keep the last pass, and the fastest time."""
    repeat = plan.spec.repeat
    values = resolve_settings(plan.spec, plan.variables)
    seconds = []
    for turn in range(repeat):
        if turn:
            fmu.reset()
        initialize(fmu, values, plan.start, plan.stop)
        begun = perf_counter()
        trace = record_run(plan, fmu, report, turn)
        seconds.append(perf_counter() - begun)
    return build_trajectory(plan, fmu, trace, min(seconds))


def initialize(fmu: Any, values: Iterable[tuple[Any, float]], start: float, stop: float | None) -> None:
    """Set the values of variables, and initialise; times in s."""
    for variable, value in values:
        set_variable(fmu, variable, value)
    fmu.setupExperiment(startTime=start, stopTime=stop)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()


def set_variable(fmu: Any, variable: Any, value: float) -> None:
    """Set one variable."""
    if variable.type == "Real":
        fmu.setReal([variable.valueReference], [value])
    else:
        fmu.setInteger([variable.valueReference], [int(value)])


def record_run(plan: RunPlan, fmu: Any, report: ProgressCallback, turn: int) -> RecordedSamples:
    """Step from start to stop, and record every communication point; `turn` passes came before.

    The arrays and the C functions are bound once, since at a few microseconds a step looking them up would show.
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
    nearly = 1e-9 * grid if grid else 0.0  # a grid point this close to the end of a step is that end
    t, point, turns = start, 1, 0
    record(t)
    while t < stop:
        target, ends = stop, False
        if grid:
            while start + point * grid <= t + nearly:
                point += 1
            if start + point * grid < stop - nearly:
                target = start + point * grid
        if signals:
            target = min(target, signals.next_jump(t))
        # an input that was set at an event restarts the solver there, up to a rounding before it
        passed = signals is not None and reals[next_at] <= t + nearly
        if follow and reals[next_at] <= target + nearly and not passed:
            target, ends = min(reals[next_at], stop), True
        if not target > t:
            raise HarnessError(f"{plan.spec.fmu.name}: solver.t_next = {target!r} s does not lie after t = {t!r} s")
        if signals:
            signals.apply(0.5 * (t + target))
        status = do_step(component, t, target - t, 1)
        if status > WARNING:
            raise FMICallException("fmi2DoStep", status)
        t = target
        record(t)
        if ends:
            trace.step_ends.append(len(trace.time) - 1)
        turns += 1
        if turns % REPORT_INTERVAL == 0:
            report((turn + (t - start) / (stop - start)) / plan.spec.repeat)
    return trace


def input_signals(plan: RunPlan, fmu: Any) -> InputSignals | None:
    """Return what sets the inputs of an instance, None if the run has no input signals."""
    inputs = plan.spec.inputs
    return InputSignals(inputs, fmu.setReal, plan.variables) if inputs else None


def make_buffer(variables: dict[str, Any], names: list[str], kind: Any) -> tuple[int, Any, Any]:
    """Number, value references and room for the values of the named variables."""
    n = len(names)
    return n, (c_uint * n)(*(variables[name].valueReference for name in names)), (kind * n)()


def build_trajectory(plan: RunPlan, fmu: Any, trace: RecordedSamples, seconds: float) -> Trajectory:
    """The run that a trace shows."""
    spec, variables = plan.spec, plan.variables
    time = np.array(trace.time)
    read: dict[str, np.ndarray] = {}
    for names, values in ((plan.reals, trace.reals), (plan.integers, trace.integers)):
        read |= zip(names, np.array(values).reshape(len(time), len(names)).T, strict=True)
    columns = {name: read[name] for name in spec.outputs}
    for name, column in columns.items():
        lost = np.flatnonzero(~np.isfinite(column))
        if len(lost) and variables[name].causality == "output":
            raise HarnessError(f"{spec.fmu.name}: {name} is {column[lost[0]]} at t = {time[lost[0]]} s")
    steps = events = None
    if spec.follow:
        ends = np.array(trace.step_ends)
        steps = SolverSteps(time[ends], np.diff(time[ends]), np.diff(read["solver.rejected"][ends]))
    settled = read_parameters(plan, fmu)
    if spec.follow and settled.get("friction") == "hybrid":
        at = np.flatnonzero(np.diff(read["events.count"])) + 1
        mode = read[find_mode_output(variables)]
        events = ModeChanges(np.append(time[0], read["events.t_last"][at]), np.append(mode[0], mode[at]))
    taken, refused, evaluated = (
        read_integer(plan, fmu, f"solver.{name}") for name in ("steps", "rejected", "evaluations")
    )
    return Trajectory(
        spec=spec,
        time=time,
        columns=columns,
        units={name: variable_unit(variables[name]) for name in [*columns, *settled]},
        descriptions={name: variables[name].description or name for name in columns},
        parameters=settled,
        steps=steps,
        events=events,
        statistics=Statistics(taken, refused, evaluated, seconds),
    )


def read_parameters(plan: RunPlan, fmu: Any) -> dict[str, float | str]:
    """The value of every parameter in the run: reals in their SI unit, enumerations by label."""
    found: dict[str, float | str] = {}
    for name, variable in plan.variables.items():
        if variable.causality == "parameter":
            if variable.type == "Enumeration":
                found[name] = enumeration_labels(variable)[read_integer(plan, fmu, name)]
            else:
                found[name] = fmu.getReal([variable.valueReference])[0]
    return found


def read_integer(plan: RunPlan, fmu: Any, name: str) -> int:
    """The present value of an integer or enumeration."""
    return fmu.getInteger([plan.variables[name].valueReference])[0]
