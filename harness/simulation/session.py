"""Session: runs of one instance of an FMU of this project, prepared once, which differ in values.

An FMU of this project runs at the ends of its solver's internal steps, at equal steps, or by model exchange. Its solver
does not depend on the communication points. A step to `solver.t_next` ends where an internal step ends, so following it
records every internal step and event through the standard interface.
"""

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from time import monotonic, perf_counter
from typing import Any

import numpy as np

from ..errors import HarnessError, SceneError, check_names, format_value
from ..process.interrupt import check_interrupt
from ..scenes.run_spec import RunSpec
from ..scenes.scene import SHORT_KEYS
from .fmu_archive import resolve_time_span
from .fmu_instance import CALL_FAILURES, FmuInstance, call_all
from .model_data import read_model_data
from .recorder import Columns, Recorder, ShapedVariable, c_type, read_rows
from .signals import ModeChanges
from .stepping import (
    CoSimulation,
    TimeGrid,
    check_inputs,
    check_rates,
    input_signals,
    make_grid,
    split_kinks,
    step_to_stop,
)
from .trajectory import SolverSteps, Statistics, Trajectory
from .variable_values import REAL_TYPES, convert_value, effective_value, enumeration_labels, variable_unit

ProgressCallback = Callable[[float], None]  # receives the progress of a run, from 0 to 1
QUIET: ProgressCallback = lambda share: None  # noqa: E731 - a function without effect needs no def

MAX_POINTS = 10_000_000  # of a grid
REPORT_INTERVAL = 4096  # communication points at most, from one report of the progress to the next
MIN_REPORTS = 50  # of the progress in a run on a grid: a report also checks the time limit
LEAST_PROGRESS = 1 / 4096  # of a run in its time limit: one of the communication steps that a run has by default
MAX_CVODE_STEPS = 500  # of model exchange, from point to point: the limit of fmpy's simulate_fmu
STEP_NAMES = ("solver.t_next", "solver.rejected", "events.count", "events.t_last")  # record internal steps and events


@dataclass(frozen=True)
class RecordedRun:
    """What one run recorded: time (n,) in s, columns (n,) by name, and evaluations of the right-hand side."""

    time: np.ndarray
    columns: Columns
    evaluations: int


class ProgressMonitor:
    """Reports the progress of a run, and raises HarnessError if it nearly stops.

    Parameters
    ----------
    spec : RunSpec
        Its `timeout` is the time in s in which the run must advance by LEAST_PROGRESS.
    grid : TimeGrid
        Communication points of the run.
    report : callable
        Receives the progress from 0 to 1.
    """

    def __init__(self, spec: RunSpec, grid: TimeGrid, report: ProgressCallback) -> None:
        self.spec, self.grid, self.report = spec, grid, report
        self.next_share, self.deadline = LEAST_PROGRESS, monotonic() + spec.timeout

    def __call__(self, share: float) -> None:
        """Report the progress."""
        self.report(share)
        now = monotonic()
        if share >= self.next_share:
            self.next_share, self.deadline = share + LEAST_PROGRESS, now + self.spec.timeout
        elif now > self.deadline:
            t, stop = self.grid.start + share * self.grid.duration, self.grid.stop
            raise HarnessError(
                f"{self.spec.fmu.name} is at t = {t:.6g} s of {stop:.6g} s, and advances by less than 1/4096 of the "
                f"run in {self.spec.timeout:g} s: shorten the run, or allow a longer timeout"
            )


class Session:
    """Runs of one instance of an FMU of this project that differ in values.

    Calls and buffers are prepared once, because a run by closed form takes 40 microseconds, as long as a few calls
    through fmpy.

    Parameters
    ----------
    instance : FmuInstance
        Instance of the FMU, which is reset before each run but its first.
    spec : RunSpec
        The run. With `exchange`, `tolerance` is that of the solver.
    varied_names : sequence of str
        Variables whose values differ from run to run.
    read_names : sequence of str
        Variables that `read` returns.

    Attributes
    ----------
    spec : RunSpec
        The run with effective values.
    grid : TimeGrid
        Communication points.

    Raises
    ------
    SceneError
        If the specification names variables or values that the FMU does not have.
    """

    def __init__(
        self, instance: FmuInstance, spec: RunSpec, varied_names: Sequence[str] = (), read_names: Sequence[str] = ()
    ) -> None:
        self.instance, self.variables = instance, instance.variables
        self.grid = plan_grid(spec, instance)
        inputs, self.note = split_kinks(spec.inputs, read_model_data(spec.fmu).rate_inputs)
        spec = replace(spec, inputs=inputs or spec.inputs)
        settings = resolve_settings(spec, self.variables)
        values = {variable.name: value for variable, value in settings}
        effective = {variable.name: effective_value(variable, value) for variable, value in settings}
        # in model exchange, the solver of the FMU takes no steps
        self.spec = replace(spec, values=effective, follow=spec.follow and not spec.exchange)
        self.prepare_start(values, varied_names)
        if not spec.exchange:
            self.step_call = instance.prepare_call(
                "DoStep", self.grid.start, self.grid.duration, 1, *instance.step_arguments
            )
        self.end = Recorder(instance, self.select([*dict.fromkeys(read_names)]), lambda row: None)

    def prepare_start(self, values: dict[str, Any], varied_names: Sequence[str]) -> None:
        """Prepare the calls that set values and initialize the instance."""
        call, start, stop = self.instance.prepare_call, self.grid.start, self.grid.stop
        is_fmi2, slots = self.instance.is_fmi2, {}
        groups: dict[str, list[str]] = {}
        for name in dict.fromkeys([*values, *varied_names]):
            groups.setdefault(self.instance.type_name(self.variables[name]), []).append(name)
        experiment = (0, 0.0, start, 1, stop)  # no tolerance
        calls = [call("SetupExperiment", *experiment)] if is_fmi2 else []
        for type_name, names in groups.items():
            variables = [self.variables[name] for name in names]
            kind = float if variables[0].type in REAL_TYPES else int
            buffer = (c_type(variables[0], is_fmi2) * len(names))()
            for i, name in enumerate(names):
                slots[name] = buffer, i, kind
                if name in values:
                    buffer[i] = values[name]
            references = self.instance.make_references(variables)
            counts = () if is_fmi2 else (len(names),)
            calls.append(call(f"Set{type_name}", references, len(variables), buffer, *counts))
        calls.append(call("EnterInitializationMode", *(() if is_fmi2 else experiment)))
        self.start_calls = [*calls, call("ExitInitializationMode")]
        self.slots = [slots[name] for name in varied_names]

    def select(self, names: Sequence[str]) -> list[ShapedVariable]:
        """Return variables by name, to record them."""
        return [(self.variables[name], ()) for name in names]

    @cached_property
    def selection(self) -> list[ShapedVariable]:
        """Return the variables to record: the outputs, and those that expose internal steps and events."""
        names = list(self.spec.outputs)
        if self.spec.follow:
            extra = (*STEP_NAMES, *read_model_data(self.spec.fmu).contacts.values())
            names += [name for name in extra if name in self.variables and name not in names]
        return self.select(names)

    @cached_property
    def rows(self) -> io.BytesIO:
        """Return the buffer of the recorded points."""
        return io.BytesIO()

    @cached_property
    def recorder(self) -> Recorder:
        """Return what records a point."""
        return Recorder(self.instance, self.selection, self.rows.write)

    def start(self, point: Sequence[float] = ()) -> None:
        """Set the values, with those of the varied variables, and initialize the instance."""
        for (buffer, i, number), value in zip(self.slots, point, strict=True):
            buffer[i] = number(value)
        self.instance.restart()
        call_all(self.start_calls)

    def step_to_stop(self) -> None:
        """Go to the stop in one communication step, without recording."""
        call_all((self.step_call,))

    def read(self) -> list[float]:
        """Return the variables to read."""
        return self.end.read_values()

    def record(self, report: ProgressCallback = QUIET) -> RecordedRun:
        """Step to the stop and record every point."""
        spec, grid, instance = self.spec, self.grid, self.instance
        report = ProgressMonitor(spec, grid, report)
        self.rows.seek(0)
        self.rows.truncate()
        signals = input_signals(spec, instance)
        if spec.exchange:
            from .model_exchange import ModelExchange  # loads CVode

            exchange = ModelExchange(instance, grid, spec.rtol, check_interrupt, signals, MAX_CVODE_STEPS)
            step_to_stop(exchange, grid, self.recorder.record, report)
            evaluations = exchange.solver.n_rhs
        else:
            next_step = self.recorder.cell("solver.t_next") if spec.follow else None
            report_every = (
                max(1, min(REPORT_INTERVAL, grid.whole_count // MIN_REPORTS)) if grid.h < inf else REPORT_INTERVAL
            )
            stepper = CoSimulation(instance, grid, signals, next_step)
            step_to_stop(stepper, grid, self.recorder.record, report, report_every)
            evaluations = instance.get("solver.evaluations")
        # not getbuffer(): a view that a profiler still references would keep the next run from emptying the buffer
        return RecordedRun(*read_rows(self.rows.getvalue(), self.selection, instance.is_fmi2), evaluations)

    def run(self, point: Sequence[float] = (), report: ProgressCallback = QUIET) -> Trajectory:
        """Run `repeat` times with the values of the varied variables; return the last run with the fastest time.

        Raises
        ------
        HarnessError
            If the run fails, with the message of the FMU.
        """
        repeat, seconds = self.spec.repeat, list[float]()
        try:
            for _ in range(repeat):
                self.start(point)
                start_time = perf_counter()
                recorded_run = self.record(lambda share: report((len(seconds) + share) / repeat))
                seconds.append(perf_counter() - start_time)
            return self.build_trajectory(recorded_run, min(seconds))
        except CALL_FAILURES as error:
            raise HarnessError(self.instance.log.error_message or f"{self.spec.fmu.name}: {error}") from None

    def build_trajectory(self, recorded_run: RecordedRun, seconds: float) -> Trajectory:
        """Build the trajectory of a run that has ended; `seconds` is its run time in s."""
        spec, variables, time, samples = self.spec, self.variables, recorded_run.time, recorded_run.columns
        columns = {name: samples[name] for name in spec.outputs}
        for name, column in columns.items():
            invalid = np.flatnonzero(~np.isfinite(column))
            if len(invalid) and variables[name].causality == "output":
                raise HarnessError(f"{spec.fmu.name}: {name} is {column[invalid[0]]} at t = {time[invalid[0]]} s")
        steps = events = None
        if spec.follow:
            ends = find_step_ends(time, samples["solver.t_next"], self.grid.tolerance)
            steps = SolverSteps(time[ends], np.diff(time[ends]), np.diff(samples["solver.rejected"][ends]))
        effective = self.read_parameters()
        contacts = read_model_data(spec.fmu).contacts
        if spec.follow and contacts and effective.get("friction") == "hybrid":
            at = np.flatnonzero(np.diff(samples["events.count"])) + 1
            rows = np.append(0, at)
            modes = {contact: samples[mode][rows].astype(int) for contact, mode in contacts.items()}
            events = ModeChanges(np.append(time[0], samples["events.t_last"][at]), modes, contacts)
        return Trajectory(
            time,
            columns,
            {name: variable_unit(variables[name]) if name in variables else "" for name in [*columns, *effective]},
            {name: variables[name].description or name for name in columns},
            events,
            spec=spec,
            parameters=effective,
            steps=steps,
            note=self.note,
            statistics=replace(read_statistics(self.instance, seconds), evaluations=recorded_run.evaluations),
        )

    def read_parameters(self) -> dict[str, float | str]:
        """Return the value of every parameter: reals in SI units, enumerations by label, also those that are fixed."""
        fixed_labels: dict[str, float | str] = {
            name: label for name, (label, _) in read_model_data(self.spec.fmu).fixed_choices.items()
        }
        get = self.instance.get
        return fixed_labels | {
            name: enumeration_labels(variable)[get(name)] if variable.type == "Enumeration" else get(name)
            for name, variable in self.variables.items()
            if variable.causality == "parameter"
        }


def plan_grid(spec: RunSpec, instance: FmuInstance) -> TimeGrid:
    """Return the communication points of a run; SceneError if its inputs or its grid are not valid."""
    start, stop = resolve_time_span(spec, instance.description)
    check_inputs(spec.inputs, instance.variables, spec.values)
    check_rates(spec.fmu, spec.inputs, spec.values)
    grid = make_grid(spec, start, stop)
    if (points := grid.duration / grid.h) > MAX_POINTS:
        key, step = ("grid", grid.h) if spec.interval is None else ("interval", spec.interval)
        sentence = f"{key} = {step!r} s makes {points:.6g} points from {start!r} s to {stop!r} s"
        raise SceneError(f"{sentence}; the limit is {MAX_POINTS}: choose a larger {key} or a shorter run")
    return grid


def resolve_settings(run: RunSpec, variables: dict[str, Any]) -> list[tuple[Any, float | int]]:
    """Return variables and values to set before the run, checked against their declared ranges."""
    settable = [name for name, variable in variables.items() if variable.causality in ("parameter", "input")]
    fixed_choices = read_model_data(run.fmu).fixed_choices
    for name in run.values.keys() & fixed_choices.keys():
        if run.values[name] not in fixed_choices[name]:
            setting = f"{name} = {format_value(run.values[name])}"
            raise SceneError(f"{setting}: {run.fmu.name} was built with {fixed_choices[name][0]} only; remove it")
    values = {name: value for name, value in run.values.items() if name not in fixed_choices}
    for key, name in SHORT_KEYS.items():
        if name in values and name not in variables:
            setting = f"{key} = {format_value(values[name])}"
            raise SceneError(f"{setting}: {run.model} has no such choice; remove {key}")
    for name, value in values.items():
        if name in variables and name not in settable:
            raise SceneError(
                f"{name} = {format_value(value)}: {name} is calculated; to set the start value of a state, "
                f"declare a Fixed in the model and pass it as start=; allowed: {', '.join(sorted(settable))}"
            )
    check_names("name in [values]", values, settable)
    return [(variables[name], convert_value(variables[name], value)) for name, value in values.items()]


def find_step_ends(time: np.ndarray, next_step: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the rows at which internal steps end, start included.

    `next_step` (n,) is `solver.t_next` at the times (n,), in s; an internal step may end a rounding after the stop.
    """
    end_times, expected = time[1:], next_step[:-1]
    is_end = (end_times == expected) | (
        (end_times == time[-1]) & (end_times < expected) & (expected <= end_times + tolerance)
    )
    return np.append(0, np.flatnonzero(is_end) + 1)


def read_statistics(instance: FmuInstance, seconds: float) -> Statistics:
    """Return the counts of a run that has ended; `seconds` is its run time in s."""
    steps, rejected_steps, evaluations = (
        instance.get(f"solver.{name}") for name in ("steps", "rejected", "evaluations")
    )
    if "events.count" not in instance.variables:
        return Statistics(steps, rejected_steps, evaluations, seconds)
    return Statistics(
        steps, rejected_steps, evaluations, seconds, instance.get("events.count"), instance.get("events.t_last")
    )
