"""Runs any FMU: one of this project by `run_own_fmu`, an external one with step refinement (external/simulation.py).

An FMU of this project runs at the ends of its solver's internal steps, at equal steps, or by model exchange. Its solver
does not depend on the communication points. A step to `solver.t_next` ends where an internal step ends, so following it
records every internal step and event through the standard interface.
"""

import io
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from time import monotonic, perf_counter
from typing import Any

import numpy as np

from ..errors import HarnessError, SceneError, check_names, format_value
from ..process.interrupt import check_interrupt
from ..scenes.run_spec import RunSpec
from ..scenes.scene import SHORT_KEYS
from .fmu_archive import (
    REQUIRED_VARIABLES,
    exposes_solver_steps,
    read_description,
    read_fixed_choices,
    resolve_time_span,
    unpack,
)
from .fmu_contacts import read_contacts
from .fmu_session import CALL_FAILURES, FmuSession, LogCapture, capture_stderr
from .recorder import Columns, Recorder, ShapedVariable, default_outputs, read_rows
from .signals import ModeChanges
from .stepping import (
    POINT_TOLERANCE,
    CoSimulation,
    TimeGrid,
    check_inputs,
    input_signals,
    make_grid,
    step_to_stop,
)
from .trajectory import SolverSteps, Statistics, Trajectory
from .variable_values import convert_value, effective_value, enumeration_labels, variable_unit

ProgressCallback = Callable[[float], None]  # receives the progress of a run, from 0 to 1

DEFAULT_COMMUNICATION_STEPS = 512  # of a run without a communication step of its own
MAX_POINTS = 10_000_000  # of a grid
REPORT_INTERVAL = 4096  # communication points at most, from one report of the progress to the next
MIN_REPORTS = 50  # of the progress in a run on a grid: a report also checks the time limit
LEAST_PROGRESS = 1 / 4096  # of a run in its time limit: one of the communication steps that a run has by default
MAX_CVODE_STEPS = 500  # of model exchange, from point to point: the limit of fmpy's simulate_fmu


@dataclass(frozen=True)
class RunPlan:
    """Resolved run: communication points, and the names of the variables to read at each."""

    spec: RunSpec
    variables: dict[str, Any]
    grid: TimeGrid
    names: list[str]

    @property
    def chosen(self) -> list[ShapedVariable]:
        """Return the variables to record."""
        return [(self.variables[name], ()) for name in self.names]

    @property
    def settings(self) -> list[tuple[Any, float | int]]:
        """Return variables and values to set, checked against their declared ranges."""
        return resolve_settings(self.spec, self.variables)


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
                f"run in {self.spec.timeout:g} s: choose an earlier stop or a longer timeout"
            )


def run(spec: RunSpec, report: ProgressCallback) -> Trajectory:
    """Run an FMU as specified; without outputs in the specification, record all of them.

    Parameters
    ----------
    spec : RunSpec
    report : callable
        Receives the progress of the run, from 0 to 1.

    Raises
    ------
    SceneError
        If the specification is not valid.
    HarnessError
        If the run fails and there is nothing to show.
    """
    if len(spec.times) and spec.interval is not None:
        raise SceneError("times and interval exclude each other: remove one")
    description = read_description(spec.fmu, spec.lenient)
    spec = replace(spec, outputs=spec.outputs or default_outputs(description, spec.values))
    if not spec.outputs:
        raise HarnessError(f"{spec.fmu.name} has no outputs or locals to record")
    if exposes_solver_steps(description) and not spec.exchange:
        trajectory = run_own_fmu(spec, report)
    else:
        from .external import simulation as external

        trajectory = external.simulate(spec, description, report)
    if len(spec.times):
        return keep_times(trajectory, np.asarray(spec.times, dtype=float))
    return trajectory if spec.interval is None else keep_interval(trajectory, spec.interval)


def keep_times(run: Trajectory, times: np.ndarray) -> Trajectory:
    """Keep the points of a run nearest to times in s, after an event there; the last one if it ends before them all."""
    reached = times[times <= run.time[-1] + POINT_TOLERANCE * (run.time[-1] - run.time[0])]
    before = np.searchsorted(run.time, reached, "right") - 1
    after = np.minimum(before + 1, len(run.time) - 1)
    rows = np.where(run.time[after] - reached < reached - run.time[before], after, before)
    return keep_rows(run, rows if len(rows) else np.array([len(run.time) - 1]))


def keep_interval(run: Trajectory, interval: float) -> Trajectory:
    """Keep one point of a run at each multiple of an interval in s, after an event there, and its last one."""
    start = run.time[0]
    multiples = np.rint((run.time - start) / interval)
    distances = np.abs(start + multiples * interval - run.time)
    near = np.flatnonzero(distances <= POINT_TOLERANCE * interval)
    order = near[np.lexsort((-near, distances[near], multiples[near]))]  # of points as near as another, the last
    rows = order[np.unique(multiples[order], return_index=True)[1]]
    return keep_rows(run, np.union1d(rows, len(run.time) - 1))


def keep_rows(run: Trajectory, rows: np.ndarray) -> Trajectory:
    """Keep rows of a run, given by indices or by one Boolean for each."""
    return replace(run, time=run.time[rows], columns={name: column[rows] for name, column in run.columns.items()})


def run_own_fmu(spec: RunSpec, report: ProgressCallback = lambda share: None) -> Trajectory:
    """Run an FMU of this project as specified; with `exchange`, `tolerance` is that of the solver.

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
    with open_session(spec) as session:
        try:
            return run_repeats(plan_run(spec, session.description), session, report)
        except CALL_FAILURES as error:
            raise HarnessError(session.log.error_message or f"{spec.fmu.name}: {error}") from None


def read_own_description(spec: RunSpec) -> Any:
    """Return the model description of an FMU of this project.

    Raises
    ------
    HarnessError
        If it cannot be read or does not offer the interface.
    SceneError
        If the specification does not fit the FMU.
    """
    description = read_description(spec.fmu)
    if (description.modelExchange if spec.exchange else description.coSimulation) is None:
        raise HarnessError(f"{spec.fmu.name} offers no {'model exchange' if spec.exchange else 'co-simulation'}")
    check_fmu(spec, {variable.name: variable for variable in description.modelVariables})
    return description


@contextmanager
def open_session(spec: RunSpec, unpacked: Path | None = None) -> Iterator[FmuSession]:
    """Instantiate an FMU, unpacked in a temporary directory or before; capture its messages."""
    description = read_own_description(spec)
    with ExitStack() as stack:
        folder = unpacked or stack.enter_context(unpack(spec.fmu))
        log = LogCapture(stack.enter_context(capture_stderr()))
        try:
            session = FmuSession(description, folder, spec.exchange, spec.model, log)
        except HarnessError as error:
            raise HarnessError(f"{spec.fmu.name} cannot be loaded: {error}") from None
        stack.callback(session.close)
        yield session


def plan_run(spec: RunSpec, description: Any) -> RunPlan:
    """Resolve times and variables of a run; add the variables that expose internal steps and events."""
    variables = {variable.name: variable for variable in description.modelVariables}
    if spec.exchange:
        spec = replace(spec, follow=False)  # the solver of the FMU takes no steps
    start, stop = resolve_time_span(spec, description)
    check_inputs(spec.inputs, variables)
    grid = make_grid(spec, start, stop)
    if (points := grid.duration / grid.h) > MAX_POINTS:
        sentence = f"grid = {grid.h!r} s makes {points:.6g} points from {start!r} s to {stop!r} s"
        raise SceneError(f"{sentence}; the limit is {MAX_POINTS}: choose a larger grid")
    names = list(spec.outputs)
    if spec.follow:
        extra = (
            "solver.t_next",
            "solver.rejected",
            "events.count",
            "events.t_last",
            *read_contacts(spec.fmu).values(),
        )
        names += [name for name in extra if name in variables and name not in names]
    return RunPlan(spec, variables, grid, names)


def check_fmu(run: RunSpec, variables: dict[str, Any]) -> None:
    """Check that the FMU is one of this project and has the outputs to record."""
    for name in REQUIRED_VARIABLES:
        if name not in variables:
            raise SceneError(f"{run.fmu.name} has no variable {name}: it is not an FMU of this project")
    readable = [name for name, variable in variables.items() if variable.causality in ("output", "local")]
    check_names("output", run.outputs, readable)


def resolve_settings(run: RunSpec, variables: dict[str, Any]) -> list[tuple[Any, float | int]]:
    """Return variables and values to set before the run, checked against their declared ranges."""
    settable = [name for name, variable in variables.items() if variable.causality in ("parameter", "input")]
    fixed = read_fixed_choices(run.fmu)
    for name in run.values.keys() & fixed.keys():
        if run.values[name] not in fixed[name]:
            setting = f"{name} = {format_value(run.values[name])}"
            raise SceneError(f"{setting}: {run.fmu.name} was built with {fixed[name][0]} only; remove it")
    values = {name: value for name, value in run.values.items() if name not in fixed}
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


def run_repeats(plan: RunPlan, session: FmuSession, report: ProgressCallback) -> Trajectory:
    """Run the plan `repeat` times in one session; return the last run with the fastest time."""
    repeat, grid = plan.spec.repeat, plan.grid
    values = plan.settings
    effective_values = {variable.name: effective_value(variable, value) for variable, value in values}
    plan = replace(plan, spec=replace(plan.spec, values=effective_values))
    seconds: list[float] = []

    def report_run(share: float) -> None:
        report((len(seconds) + share) / repeat)

    for index in range(repeat):
        if index:
            session.reset()
        session.initialize(values, grid.start, grid.stop)
        started = perf_counter()
        recorded = record_run(plan, session, report_run)
        seconds.append(perf_counter() - started)
    return build_trajectory(plan, session, recorded, min(seconds))


def record_run(plan: RunPlan, session: FmuSession, report: ProgressCallback) -> RecordedRun:
    """Step from start to stop and record every point."""
    spec, grid, selection, rows = plan.spec, plan.grid, plan.chosen, io.BytesIO()
    report = ProgressMonitor(spec, grid, report)
    recorder, signals = Recorder(session, selection, rows.write), input_signals(spec.inputs, session)
    if spec.exchange:
        from .model_exchange import ModelExchange  # loads CVode

        exchange = ModelExchange(session, grid, spec.rtol, check_interrupt, signals, MAX_CVODE_STEPS)
        step_to_stop(exchange, grid, recorder.record, report)
        return RecordedRun(*read_rows(rows.getbuffer(), selection, session.is_fmi2), exchange.solver.n_rhs)
    next_step = recorder.cell("solver.t_next") if spec.follow else None
    stepper = CoSimulation(session, grid, signals, next_step)
    interval = max(1, min(REPORT_INTERVAL, grid.whole_count // MIN_REPORTS)) if grid.h < inf else REPORT_INTERVAL
    step_to_stop(stepper, grid, recorder.record, report, interval)
    return RecordedRun(*read_rows(rows.getbuffer(), selection, session.is_fmi2), session.get("solver.evaluations"))


def build_trajectory(plan: RunPlan, session: FmuSession, recorded: RecordedRun, seconds: float) -> Trajectory:
    """Build the trajectory of a run that has ended; `seconds` is its run time in s."""
    spec, variables, time, samples = plan.spec, plan.variables, recorded.time, recorded.columns
    columns = {name: samples[name] for name in spec.outputs}
    for name, column in columns.items():
        invalid = np.flatnonzero(~np.isfinite(column))
        if len(invalid) and variables[name].causality == "output":
            raise HarnessError(f"{spec.fmu.name}: {name} is {column[invalid[0]]} at t = {time[invalid[0]]} s")
    steps = events = None
    if spec.follow:
        ends = find_step_ends(time, samples["solver.t_next"], plan.grid.tolerance)
        steps = SolverSteps(time[ends], np.diff(time[ends]), np.diff(samples["solver.rejected"][ends]))
    effective = read_parameters(session, spec.fmu)
    contacts = read_contacts(spec.fmu)
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
        statistics=replace(read_statistics(session, seconds), evaluations=recorded.evaluations),
    )


def find_step_ends(time: np.ndarray, next_step: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the rows at which internal steps end, start included.

    `next_step` (n,) is `solver.t_next` at the times (n,), in s; an internal step may end a rounding after the stop.
    """
    end_times, expected = time[1:], next_step[:-1]
    is_end = (end_times == expected) | (
        (end_times == time[-1]) & (end_times < expected) & (expected <= end_times + tolerance)
    )
    return np.append(0, np.flatnonzero(is_end) + 1)


def read_statistics(session: FmuSession, seconds: float) -> Statistics:
    """Return the counts of a run that has ended; `seconds` is its run time in s."""
    steps, rejected, evaluations = (session.get(f"solver.{name}") for name in ("steps", "rejected", "evaluations"))
    if "events.count" not in session.variables:
        return Statistics(steps, rejected, evaluations, seconds)
    return Statistics(steps, rejected, evaluations, seconds, session.get("events.count"), session.get("events.t_last"))


def read_parameters(session: FmuSession, fmu: Path) -> dict[str, float | str]:
    """Return the value of every parameter: reals in SI units, enumerations by label, also those that are fixed."""
    fixed: dict[str, float | str] = {name: label for name, (label, _) in read_fixed_choices(fmu).items()}
    return fixed | {
        name: enumeration_labels(variable)[session.get(name)] if variable.type == "Enumeration" else session.get(name)
        for name, variable in session.variables.items()
        if variable.causality == "parameter"
    }
