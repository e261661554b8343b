"""One FMU run again and again: what a sweep does in each of its workers.

Of ours one instance is reset before each run, and the room for what is set and read is made once: a run by closed form
takes 40 microseconds.  Others are run as `run --fmu` runs them, with steps that are halved until two results agree.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import c_double, c_int, c_void_p
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from ...errors import HarnessError, check_names
from ...running import runner
from ...running.description import read_description
from ...running.fmi2 import (
    WARNING,
    FMICallException,
    LogCapture,
    build_trajectory,
    make_buffer,
    open_instance,
    plan_run,
    read_parameters,
    record_run,
)
from ...running.run_spec import RunSpec
from ...running.settings import resolve_settings
from ...running.variable_values import variable_unit
from ...scenes.roles import find_roles
from .measures import (
    DEFAULT_MEASURES,
    FINAL_MEASURES,
    N_STEPS,
    OUTPUT_MEASURES,
    TRAJECTORY_MEASURES,
    available_measures,
    columns,
    measure_outputs,
)


@dataclass(frozen=True)
class SweepSpec:
    """What the runs of a sweep share: the `varied` names, the `values` of others, `measures` (none: the usual ones),
    and what else a Specification holds, by name."""

    model: str
    varied: tuple[str, ...]
    values: tuple[tuple[str, float | str], ...]
    measures: tuple[str, ...]
    options: tuple[tuple[str, Any], ...] = ()


class OwnFmuRunner:
    """An instance of an FMU of ours.  The library is called as it stands: fmpy's own calls take as long as a run.

    `columns` are what is measured in a run; `stop` is the time in s at which one stops.
    """

    def __init__(self, runs: SweepSpec, found: Any, fmu: Any, heard: LogCapture, wanted: RunSpec) -> None:
        self.fmu, self.component, self.heard = fmu, c_void_p(fmu.component), heard
        self.variables = {variable.name: variable for variable in found.modelVariables}
        measures = select_measures(runs, self.variables, ours=True)
        motion = find_roles(self.variables)
        outputs = tuple(motion[role] for role in ("position", "velocity") if role in motion)
        if len(outputs) < 2:
            outputs = tuple(name for name in runner.default_outputs(found) if self.variables[name].type == "Real")
        self.plan = plan_run(replace(wanted, outputs=outputs), found)
        self.stop = self.plan.stop
        ends = [name for name in measures if name in FINAL_MEASURES]
        self.along = [
            name for name in measures if name in TRAJECTORY_MEASURES or (name in OUTPUT_MEASURES and name != "final")
        ]
        if self.along:
            grid = (self.stop - self.plan.start) / N_STEPS
            self.plan = plan_run(replace(self.plan.spec, grid=grid, follow=True), found)
        self.n_real, self.real_at, self.real = make_buffer(self.variables, list(outputs), c_double)
        self.n_whole, self.whole_at, self.whole = make_buffer(
            self.variables, [FINAL_MEASURES[name][1] for name in ends], c_int
        )
        self.columns = columns(measures, self.variables, outputs)
        read = [each.name for each in columns(["final", *ends, "run_time", *self.along], self.variables, outputs)]
        self.order = [read.index(column.name) for column in self.columns]
        self.slots: list[tuple[Any, int, type]] = []
        self.calls = self.prepare_calls(resolve_settings(self.plan.spec, self.variables), runs.varied)

    def prepare_calls(
        self, fixed: list[tuple[Any, float]], varied: Sequence[str]
    ) -> list[tuple[str, Any, tuple[Any, ...]]]:
        """The calls that reset, set and initialise; `slots` tells where they take each varied value from, as what."""
        values = {variable.name: value for variable, value in fixed}
        calls: list[tuple[Any, ...]] = [("fmi2Reset",)]
        slots = {}
        for function, kind, number in (("fmi2SetReal", c_double, float), ("fmi2SetInteger", c_int, int)):
            names = [name for name in (*values, *varied) if (self.variables[name].type == "Real") is (number is float)]
            n, at, held = make_buffer(self.variables, names, kind)
            for i, name in enumerate(names):
                held[i], slots[name] = values.get(name, 0), (held, i, number)
            calls += [(function, at, n, held)] if n else []
        self.slots = [slots[name] for name in varied]
        calls += [("fmi2SetupExperiment", 0, 0.0, self.plan.start, 1, self.stop)]
        calls += [("fmi2EnterInitializationMode",), ("fmi2ExitInitializationMode",)]
        return [(name, getattr(self.fmu.dll, name), (self.component, *rest)) for name, *rest in calls]

    def run(self, point: Sequence[float]) -> list[float] | str:
        """The measures at a point of the varied values, or the sentence why there are none."""
        self.heard.clear()
        try:
            return self.measure_run(point)
        except FMICallException as error:
            return self.heard.error_message or str(error)
        except HarnessError as error:
            return str(error)

    def measure_run(self, point: Sequence[float]) -> list[float]:
        """The measures; an exception if the run fails."""
        for (held, i, number), value in zip(self.slots, point, strict=True):
            held[i] = number(value)
        for name, function, arguments in self.calls:
            check_status(name, function(*arguments))
        start, dll = self.plan.start, self.fmu.dll
        begun, along = perf_counter(), []
        if self.along:
            run = build_trajectory(self.plan, self.fmu, record_run(self.plan, self.fmu, lambda share: None, 0), 0.0)
            for name in self.along:
                along += (
                    measure_outputs(name, run.columns)
                    if name in OUTPUT_MEASURES
                    else [TRAJECTORY_MEASURES[name].measure(run)]
                )
        else:
            check_status("fmi2DoStep", dll.fmi2DoStep(self.component, start, self.stop - start, 1))
        seconds = perf_counter() - begun
        check_status("fmi2GetReal", dll.fmi2GetReal(self.component, self.real_at, self.n_real, self.real))
        check_status("fmi2GetInteger", dll.fmi2GetInteger(self.component, self.whole_at, self.n_whole, self.whole))
        read = [*self.real, *self.whole, seconds, *along]
        return [read[i] for i in self.order]

    def constants(self) -> dict[str, tuple[object, str]]:
        """The value of every parameter in the last run, and its unit."""
        return {
            name: (value, variable_unit(self.variables[name]))
            for name, value in read_parameters(self.plan, self.fmu).items()
        }


def check_status(function: str, status: int) -> None:
    if status > WARNING:
        raise FMICallException(function, status)


class ExternalFmuRunner:
    """The same of an FMU that does not show its steps; each run is in a process of its own, whole or a sentence."""

    def __init__(self, runs: SweepSpec, found: Any, wanted: RunSpec) -> None:
        self.varied, self.stop = runs.varied, 0.0
        self.variables = {variable.name: variable for variable in found.modelVariables}
        self.measures = select_measures(runs, self.variables, ours=False)
        texts = {name for name, variable in self.variables.items() if variable.type == "String"}
        outputs = tuple(name for name in runner.default_outputs(found) if name not in texts)
        self.wanted = replace(wanted, outputs=outputs)
        self.columns = columns(self.measures, self.variables, outputs)
        self.told: dict[str, tuple[object, str]] = {}

    def run(self, point: Sequence[float]) -> list[float] | str:
        values = {**self.wanted.values, **dict(zip(self.varied, point, strict=True))}
        begun = perf_counter()
        try:
            found = runner.run(replace(self.wanted, values=values), lambda share: None)
        except HarnessError as error:
            return str(error)
        seconds = perf_counter() - begun
        if found.failure:
            return found.failure
        self.told, self.stop = found.effective_parameters, float(found.time[-1])
        row: list[float] = []
        for name in self.measures:
            row += [seconds] if name == "run_time" else measure_outputs(name, found.columns)
        return row

    def constants(self) -> dict[str, tuple[object, str]]:
        return self.told


Runner = OwnFmuRunner | ExternalFmuRunner


def select_measures(runs: SweepSpec, variables: dict[str, Any], ours: bool) -> tuple[str, ...]:
    """The measures of an FMU; SceneError if it cannot give one."""
    there = available_measures(variables, ours, dict(runs.values))
    check_names(f"measure of {runs.model}", runs.measures, there)
    return runs.measures or tuple(name for name in DEFAULT_MEASURES if name in there)


def run_spec_of(runs: SweepSpec, file: Path) -> RunSpec:
    """What all of them run."""
    return RunSpec(file, values=dict(runs.values), follow=False, **dict(runs.options))


@contextmanager
def open_runner(runs: SweepSpec, file: Path) -> Iterator[Runner]:
    """The FMU in a file, ready to run."""
    wanted = run_spec_of(runs, file)
    found = read_description(file, wanted.lenient)
    if runner.exposes_solver_steps(found):
        with open_instance(wanted) as (_, fmu, heard):
            yield OwnFmuRunner(runs, found, fmu, heard, wanted)
    else:
        yield ExternalFmuRunner(runs, found, replace(wanted, follow=True))
