"""Runs of one FMU at points of a sweep, and what is measured in each run.

An FMU of this project is instantiated once and reset before each run.  Other FMUs are run as by `run`, with step
refinement, in one worker process.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from threading import Lock
from time import perf_counter
from typing import Any

import numpy as np

from ..errors import HarnessError, check_names
from ..scenes.roles import find_roles
from ..scenes.run_spec import RunSpec
from ..simulation.fmu_archive import read_description, resolve_time_span
from ..simulation.fmu_instance import CALL_FAILURES
from ..simulation.recorder import default_outputs
from ..simulation.runner import open_session, runs_in_process
from ..simulation.session import Session
from ..simulation.signals import column_of_role
from ..simulation.trajectory import Trajectory, effective_parameters, get_parameter
from ..simulation.variable_values import variable_unit
from .decay.decrement import find_extrema_from_velocity
from .decay.law import damping_ratio, friction_from_envelope
from .slip import peak_value, slips_from_modes, upward_crossings

N_STEPS = 400  # communication steps along a trajectory, in addition to the internal steps


@dataclass(frozen=True)
class MeasureColumn:
    """One measured number per run: name, unit and description."""

    name: str
    unit: str
    text: str


@dataclass(frozen=True)
class TrajectoryMeasure:
    """A measure along the trajectory.

    Attributes
    ----------
    variables : tuple of str
        Variables that the FMU must have.
    unit, text : str
        Unit and description.
    measure : callable
        Computes the measure of a run.
    modes : bool
        Whether the friction law must have modes.
    decay : bool
        Whether the model must have no driver.
    role : str
        Role of the output that has the same unit.
    """

    variables: tuple[str, ...]
    unit: str
    text: str
    measure: Callable[[Trajectory], float]
    modes: bool = False
    decay: bool = False
    role: str = ""


def slip_starts(run: Trajectory) -> np.ndarray:
    """Return the times in s at which slips begin."""
    if run.events is not None:
        return slips_from_modes(run.events.t, run.events.mode)[0]
    driver = get_parameter(run, "v_driver", "the measure 'slips'")
    return (
        upward_crossings(run.time, column_of_role(run, "velocity") * np.sign(driver) - abs(driver))
        if driver
        else np.array([])
    )


def period(run: Trajectory) -> float:
    times = slip_starts(run)
    return float(np.mean(np.diff(times))) if len(times) > 1 else np.nan


def peak_speed(run: Trajectory) -> float:
    speed = np.abs(column_of_role(run, "velocity"))
    return peak_value(run.time, speed, np.ones(len(speed), bool))


def stuck_time(run: Trajectory) -> float:
    if run.events is None:
        return np.nan
    lengths = np.diff(np.append(run.events.t, run.time[-1]))
    return float(lengths[run.events.mode == 0].sum())


def rest(run: Trajectory) -> float:
    return float(column_of_role(run, "position")[-1]) if run.events and run.events.mode[-1] == 0 else np.nan


def unsteady(run: Trajectory) -> float:
    driver = get_parameter(run, "v_driver", "the measure 'unsteady'")
    second_half = column_of_role(run, "velocity")[2 * run.time > run.time[0] + run.time[-1]]
    return float(np.ptp(second_half) / 2 / abs(driver)) if driver else np.nan


def evaluate_decay(run: Trajectory, law: Callable[[float, float, float], float]) -> float:
    """Evaluate `law` for the first and last turning point of a free decay about zero."""
    _, extrema_values = find_extrema_from_velocity(
        run.time, column_of_role(run, "position"), column_of_role(run, "velocity")
    )
    sizes = extrema_values * np.where(np.arange(len(extrema_values)) % 2, -1.0, 1.0) * np.sign(extrema_values[:1])
    extrema_values = sizes[sizes > 0]  # the last one may stop on the same side
    try:
        return (
            law(float(extrema_values[0]), float(extrema_values[-1]), (len(extrema_values) - 1) / 2)
            if len(extrema_values) > 1
            else np.nan
        )
    except HarnessError:
        return np.nan


zeta = partial(evaluate_decay, law=damping_ratio)
f_over_k = partial(evaluate_decay, law=partial(friction_from_envelope, stiffness=1.0))

FINAL_MEASURES = {  # with the variable of the FMU
    "events": (MeasureColumn("events", "", "changes of mode"), "events.count"),
    "steps": (MeasureColumn("steps", "", "steps of the solver"), "solver.steps"),
    "evaluations": (MeasureColumn("evaluations", "", "right-hand side evaluations"), "solver.evaluations"),
}
DRIVER = "v_driver"
SWING = "half the range of speed in the second half of the run, over driver speed"
ENVELOPE = "friction over stiffness by linear envelope"
TRAJECTORY_MEASURES = {
    "slips": TrajectoryMeasure((DRIVER,), "", "slips", lambda run: float(len(slip_starts(run)))),
    "period": TrajectoryMeasure((DRIVER,), "s", "slip period", period),
    "unsteady": TrajectoryMeasure((DRIVER,), "1", SWING, unsteady),
    "peak_speed": TrajectoryMeasure((), "", "peak speed", peak_speed, role="velocity"),
    "stuck": TrajectoryMeasure(("mode",), "s", "time stuck", stuck_time, modes=True),
    "rest": TrajectoryMeasure(("mode",), "", "rest position", rest, modes=True, role="position"),
    "zeta": TrajectoryMeasure(("c",), "1", "damping ratio by logarithmic decrement", zeta, decay=True),
    "f_over_k": TrajectoryMeasure(("mode",), "", ENVELOPE, f_over_k, decay=True, role="position"),
}
# of every recorded output: function and description
OUTPUT_MEASURES: dict[str, tuple[Callable[[np.ndarray], Any], str]] = {
    "final": (lambda column: column[-1], "at the end"),
    "smallest": (np.min, "smallest at the points of the run"),
    "largest": (np.max, "largest at the points of the run"),
}
DEFAULT_MEASURES = ("final", "events")


def available_measures(variables: Collection[str], is_own_fmu: bool, values: Mapping[str, object]) -> list[str]:
    """Return the measures available for an FMU with these variables and values.

    `is_own_fmu` is false for external FMUs, which expose neither internal steps nor modes.
    """
    names = [*OUTPUT_MEASURES, "run_time"]
    if not is_own_fmu:
        return names
    names += [name for name, (_, variable) in FINAL_MEASURES.items() if variable in variables]
    if {"position", "velocity"} <= set(find_roles(variables)):
        for name, measure in TRAJECTORY_MEASURES.items():
            has_law = not measure.modes or values.get("friction", "hybrid") in ("hybrid", 1)
            if has_law and set(measure.variables) <= set(variables) and not (measure.decay and DRIVER in variables):
                names.append(name)
    return names


def measure_columns(
    measures: Iterable[str], variables: Mapping[str, Any], outputs: Iterable[str]
) -> tuple[MeasureColumn, ...]:
    """Return the columns of measures, for an FMU with these variables and recorded outputs."""
    columns: list[MeasureColumn] = []
    for measure in measures:
        if measure in OUTPUT_MEASURES:
            for name in outputs:
                variable = variables.get(name) or variables[name.partition("[")[0]]  # an array element
                text = f"{variable.description or name} {OUTPUT_MEASURES[measure][1]}"
                columns.append(MeasureColumn(f"{measure}_{name}", variable_unit(variable), text))
        elif measure == "run_time":
            columns.append(MeasureColumn("run_time", "s", "run time"))
        elif measure in FINAL_MEASURES:
            columns.append(FINAL_MEASURES[measure][0])
        else:
            trajectory_measure = TRAJECTORY_MEASURES[measure]
            output = find_roles(variables).get(trajectory_measure.role) if not trajectory_measure.unit else None
            unit = variable_unit(variables[output]) if output else trajectory_measure.unit
            columns.append(MeasureColumn(measure, unit, trajectory_measure.text))
    return tuple(columns)


def measure_outputs(measure: str, outputs: Mapping[str, np.ndarray]) -> list[float]:
    """Evaluate a measure for every output."""
    return [float(OUTPUT_MEASURES[measure][0](column)) for column in outputs.values()]


@dataclass(frozen=True)
class SweepSpec:
    """Settings that the runs of a sweep share.

    Attributes
    ----------
    run : RunSpec
        The run, without the varied values.
    varied_names : tuple of str
        Names of the varied parameters.
    measures : tuple of str
        Names of the measures; empty for the default ones.
    """

    run: RunSpec
    varied_names: tuple[str, ...]
    measures: tuple[str, ...] = ()


class OwnFmuRunner:
    """Runs an FMU of this project in one instance.

    `columns` are the measured columns; `stop` is the stop time in s.
    """

    def __init__(self, runs: SweepSpec, description: Any, resources: ExitStack) -> None:
        self.variables = {variable.name: variable for variable in description.modelVariables}
        measures = select_measures(runs, self.variables, is_own_fmu=True)
        motion = find_roles(self.variables)
        outputs = tuple(motion[role] for role in ("position", "velocity") if role in motion)
        if len(outputs) < 2:
            outputs = tuple(name for name in default_outputs(description) if self.variables[name].type == "Real")
        run = replace(runs.run, outputs=outputs)
        ends = [name for name in measures if name in FINAL_MEASURES]
        self.trajectory_measures = [
            name for name in measures if name in TRAJECTORY_MEASURES or (name in OUTPUT_MEASURES and name != "final")
        ]
        if self.trajectory_measures:
            start, stop = resolve_time_span(run, description)
            run = replace(run, grid=(stop - start) / N_STEPS, follow=True)
        read_names = [*outputs, *(FINAL_MEASURES[name][1] for name in ends)]
        session = resources.enter_context(open_session(run, runs.varied_names, read_names))
        assert isinstance(session, Session)
        self.session = session
        self.stop = self.session.grid.stop
        self.columns = measure_columns(measures, self.variables, outputs)
        column_names = [
            column.name
            for column in measure_columns(
                ["final", *ends, "run_time", *self.trajectory_measures], self.variables, outputs
            )
        ]
        self.order = [column_names.index(column.name) for column in self.columns]

    def run(self, point: Sequence[float]) -> list[float] | str:
        """Return the measures at a point of the varied values, or the error message."""
        try:
            return self.measure_run(point)
        except CALL_FAILURES as error:
            return self.session.instance.log.error_message or str(error)
        except HarnessError as error:
            return str(error)

    def measure_run(self, point: Sequence[float]) -> list[float]:
        """Return the measures; raise an exception if the run fails."""
        self.session.start(point)
        start_time, trajectory_values = perf_counter(), []
        if self.trajectory_measures:
            trajectory = self.session.build_trajectory(self.session.record(), 0.0)
            for name in self.trajectory_measures:
                trajectory_values += (
                    measure_outputs(name, trajectory.columns)
                    if name in OUTPUT_MEASURES
                    else [TRAJECTORY_MEASURES[name].measure(trajectory)]
                )
        else:
            self.session.step_to_stop()
        seconds = perf_counter() - start_time
        values = [*self.session.read(), seconds, *trajectory_values]
        return [values[i] for i in self.order]

    def constants(self) -> dict[str, tuple[object, str]]:
        """Return value and unit of every parameter in the last run."""
        return {
            name: (value, variable_unit(self.variables[name]) if name in self.variables else "")
            for name, value in self.session.read_parameters().items()
        }


class ExternalFmuRunner:
    """Runs an FMU that does not expose its internal steps, in a worker process."""

    def __init__(self, runs: SweepSpec, description: Any, resources: ExitStack) -> None:
        self.stop = 0.0
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.measures = select_measures(runs, self.variables, is_own_fmu=False)
        texts = {name for name, variable in self.variables.items() if variable.type == "String"}
        outputs = tuple(name for name in default_outputs(description) if name not in texts)
        # a table of values has no place for the error of each run, so a run that misses the tolerance fails
        run = replace(runs.run, outputs=outputs, follow=True, tolerance=runs.run.rtol)
        self.session = resources.enter_context(open_session(run, runs.varied_names))
        self.columns = measure_columns(self.measures, self.variables, outputs)
        self.effective_values: dict[str, tuple[object, str]] = {}

    def run(self, point: Sequence[float]) -> list[float] | str:
        start = perf_counter()
        try:
            trajectory = self.session.run(point)
        except HarnessError as error:
            return str(error)
        seconds = perf_counter() - start
        if trajectory.failure:
            return trajectory.failure
        self.effective_values, self.stop = effective_parameters(trajectory), float(trajectory.time[-1])
        row: list[float] = []
        for name in self.measures:
            row += [seconds] if name == "run_time" else measure_outputs(name, trajectory.columns)
        return row

    def constants(self) -> dict[str, tuple[object, str]]:
        return self.effective_values


Runner = OwnFmuRunner | ExternalFmuRunner


def select_measures(runs: SweepSpec, variables: dict[str, Any], is_own_fmu: bool) -> tuple[str, ...]:
    """Return the measures of a sweep; SceneError if one is not available."""
    available = available_measures(variables, is_own_fmu, runs.run.values)
    check_names(f"measure of {runs.run.model}", runs.measures, available)
    return runs.measures or tuple(name for name in DEFAULT_MEASURES if name in available)


@contextmanager
def open_runner(runs: SweepSpec) -> Iterator[Runner]:
    """Open the runner of the FMU."""
    description = read_description(runs.run.fmu, runs.run.lenient)
    runner = OwnFmuRunner if runs_in_process(runs.run) else ExternalFmuRunner
    with ExitStack() as resources:
        yield runner(runs, description, resources)


BUSY = Lock()  # a pythonfmu FMU must be used by one thread at a time
RUNNERS: dict[str, Runner] = {}  # the runner of the current sweep, by its specification
RESOURCES = ExitStack()  # of this runner


@dataclass(frozen=True)
class BlockResult:
    """Results of a block.

    Attributes
    ----------
    values : numpy.ndarray
        Measures (runs, columns); NaN for failed runs.
    messages : dict
        Error messages by index in the block.
    seconds : float
        Run time in s.
    """

    values: np.ndarray
    messages: dict[int, str]
    seconds: float


def run_block(points: np.ndarray, runs: SweepSpec) -> BlockResult:
    """Run a block, with the runner of the previous one if it belongs to the same sweep."""
    with BUSY:
        runner = RUNNERS.get(repr(runs)) or load(runs)
        start = perf_counter()
        values, messages = np.full((len(points), len(runner.columns)), np.nan), {}
        for i, point in enumerate(points.tolist()):
            measures = runner.run(point)
            if isinstance(measures, str):
                messages[i] = measures
            else:
                values[i] = measures
        return BlockResult(values, messages, perf_counter() - start)


def load(runs: SweepSpec) -> Runner:
    """Load the runner of another sweep and free the previous one."""
    free()
    RUNNERS[repr(runs)] = runner = RESOURCES.enter_context(open_runner(runs))
    return runner


def free() -> None:
    RUNNERS.clear()
    RESOURCES.close()


def unload() -> None:
    """Free the instance of the current sweep."""
    with BUSY:
        free()
