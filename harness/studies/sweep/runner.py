"""Repeated runs of one FMU, in a worker of a sweep.

An FMU of this project is instantiated once and reset before each run.  Other FMUs are run as by `run`, with step
refinement, in one worker process.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

from ...errors import HarnessError, check_names
from ...scenes.roles import find_roles
from ...scenes.run_spec import RunSpec
from ...simulation.fmu_archive import read_description, resolve_time_span
from ...simulation.fmu_instance import CALL_FAILURES
from ...simulation.recorder import default_outputs
from ...simulation.runner import open_session, runs_in_process
from ...simulation.session import Session
from ...simulation.variable_values import variable_unit
from .measures import (
    DEFAULT_MEASURES,
    FINAL_MEASURES,
    N_STEPS,
    OUTPUT_MEASURES,
    TRAJECTORY_MEASURES,
    available_measures,
    measure_columns,
    measure_outputs,
)


@dataclass(frozen=True)
class SweepSpec:
    """Settings that the runs of a sweep share.

    Attributes
    ----------
    run : RunSpec
        The run, without the varied values.
    varied : tuple of str
        Names of the varied parameters.
    measures : tuple of str
        Names of the measures; empty for the default ones.
    """

    run: RunSpec
    varied: tuple[str, ...]
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
        to_read = [*outputs, *(FINAL_MEASURES[name][1] for name in ends)]
        session = resources.enter_context(open_session(run, runs.varied, to_read))
        assert isinstance(session, Session)
        self.session = session
        self.stop = self.session.grid.stop
        self.columns = measure_columns(measures, self.variables, outputs)
        read = [
            column.name
            for column in measure_columns(
                ["final", *ends, "run_time", *self.trajectory_measures], self.variables, outputs
            )
        ]
        self.order = [read.index(column.name) for column in self.columns]

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
        self.session = resources.enter_context(open_session(run, runs.varied))
        self.columns = measure_columns(self.measures, self.variables, outputs)
        self.parameters_used: dict[str, tuple[object, str]] = {}

    def run(self, point: Sequence[float]) -> list[float] | str:
        start = perf_counter()
        try:
            trajectory = self.session.run(point)
        except HarnessError as error:
            return str(error)
        seconds = perf_counter() - start
        if trajectory.failure:
            return trajectory.failure
        self.parameters_used, self.stop = trajectory.effective_parameters, float(trajectory.time[-1])
        row: list[float] = []
        for name in self.measures:
            row += [seconds] if name == "run_time" else measure_outputs(name, trajectory.columns)
        return row

    def constants(self) -> dict[str, tuple[object, str]]:
        return self.parameters_used


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
