"""One run of an FMU, step by step as told, to its end or to its refusal; what studies of stability and errors ask for.

Values go to the FMU as they are, unchecked: what it makes of NaN is the question.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from math import inf, isnan, nan
from time import perf_counter
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException

from ..errors import HarnessError
from ..scenes.fmu_files import find_fmu
from ..scenes.roles import find_roles
from .fmi2 import LogCapture, initialize, load_instance, read_own_description, set_variable
from .run_spec import RunSpec
from .unpacking import unpack_once
from .variable_values import enumeration_labels

CommunicationSteps = list[tuple[float, float]]  # communication steps: from, size in s
ScheduledChanges = dict[float, dict[str, float]]  # values by the time from which they hold, in s


@dataclass(frozen=True)
class FmuInfo:
    """What an FMU offers: its methods, the start value of every parameter and input, and the enumerations by label."""

    methods: tuple[str, ...]
    default_method: str  # method
    start_values: dict[str, float]
    enumerations: dict[str, dict[str, int]]
    stop: float

    def resolve_labels(self, values: dict[str, Any]) -> dict[str, float]:
        """Values with their labels made numbers."""
        return {
            name: self.enumerations[name][value] if isinstance(value, str) else value for name, value in values.items()
        }


@dataclass(frozen=True)
class InitialValues:
    """What is set before a run; stop is None where the importer does not know it."""

    model: str
    values: dict[str, float]
    start: float = 0.0
    stop: float | None = None


@dataclass(frozen=True)
class RunCounts:
    """Changes of mode, internal steps accepted and refused, right-hand sides."""

    events: int
    steps: int
    rejected: int
    evaluations: int


@dataclass(frozen=True)
class CompletedRun:
    """A run that came to its end: `x`, `v`, `energy` (n,) after each communication step, the start included; no energy
    where the FMU tells none.

    `t_last` is the time of the last event in s, the start where there was none.
    """

    x: np.ndarray
    v: np.ndarray
    energy: np.ndarray | None
    t_last: float
    counts: RunCounts
    seconds: float


@dataclass(frozen=True)
class RefusedRun:
    """A run that was refused: the FMU's sentence, and whether every calculated Real reads NaN."""

    message: str
    all_nan: bool


@dataclass(frozen=True)
class RefusalSummary:
    """Many of them: how many were tried, and what went wrong."""

    n_tried: int
    failures: tuple[str, ...]


def read_info(model: str) -> FmuInfo:
    """The card of a model's FMU."""
    description = read_own_description(RunSpec(find_fmu(model)))
    settable = [variable for variable in description.modelVariables if variable.causality in ("parameter", "input")]
    enumerations = {v.name: v for v in settable if v.type == "Enumeration"}
    choices = {
        name: {label: number for number, label in enumeration_labels(v).items()} for name, v in enumerations.items()
    }
    defaults = {v.name: int(v.start) if v.name in choices else float(v.start) for v in settable}
    methods = {number: label for label, number in choices["solver.method"].items()}
    default = methods[int(defaults["solver.method"])]
    return FmuInfo(tuple(methods.values()), default, defaults, choices, float(description.defaultExperiment.stopTime))


class FmuSession:
    """An instance of an FMU that can be run anew and anew."""

    def __init__(self, description: Any, fmu: Any, heard: LogCapture) -> None:
        self.fmu, self.log = fmu, heard
        self.variables = {variable.name: variable for variable in description.modelVariables}
        motion = find_roles(self.variables)
        if "velocity" not in motion:
            raise HarnessError(f"{description.modelName}: no output is the rate of a position, as derivative= says it")
        self.outputs = (motion["position"], motion["velocity"], *(["energy"] if "energy" in self.variables else []))

    def initialize(self, setting: InitialValues) -> None:
        values = ((self.variables[name], value) for name, value in setting.values.items())
        initialize(self.fmu, values, setting.start, setting.stop)

    def set_values(self, values: dict[str, float]) -> None:
        for name, value in values.items():
            set_variable(self.fmu, self.variables[name], value)

    def find_reals(self, *causalities: str) -> list[str]:
        """The names of the Reals of some causalities."""
        return [v.name for v in self.variables.values() if v.type == "Real" and v.causality in causalities]

    def get_reals(self, names: Iterable[str]) -> list[float]:
        return self.fmu.getReal([self.variables[name].valueReference for name in names])

    def get_count(self, name: str) -> int:
        return self.fmu.getInteger([self.variables[name].valueReference])[0] if name in self.variables else 0

    def read_refusal(self) -> RefusedRun:
        """What the FMU said when it refused."""
        return RefusedRun(self.log.error_message, all(map(isnan, self.get_reals(self.find_reals("output", "local")))))

    def reset(self) -> None:
        """A new beginning."""
        self.log.clear()
        self.fmu.reset()


@contextmanager
def open_session(model: str) -> Iterator[FmuSession]:
    """A fresh instance of a model's FMU, whose words are kept from the terminal."""
    spec = RunSpec(find_fmu(model))
    found = read_own_description(spec)
    with load_instance(spec, found, unpack_once(spec.fmu)) as (fmu, heard):
        yield FmuSession(found, fmu, heard)


def run_steps(
    setting: InitialValues, calls: CommunicationSteps, changes: ScheduledChanges
) -> CompletedRun | RefusedRun:
    """Make the calls, with values changed at the times that `changes` holds; a row is read after each."""
    with open_session(setting.model) as it:
        begun = perf_counter()
        try:
            it.initialize(setting)
            rows = [it.get_reals(it.outputs)]
            for t, h in calls:
                it.set_values(changes.get(t, {}))
                it.fmu.doStep(t, h)
                rows.append(it.get_reals(it.outputs))
        except FMICallException:
            return it.read_refusal()
        seconds = perf_counter() - begun
        x, v, *energy = np.array(rows).T
        t_last = it.get_reals(["events.t_last"])[0] if "events.t_last" in it.variables else setting.start
        counts = [
            it.get_count(name) for name in ("events.count", "solver.steps", "solver.rejected", "solver.evaluations")
        ]
        return CompletedRun(x, v, energy[0] if energy else None, t_last, RunCounts(*counts), seconds)


def inject_nonfinite(setting: InitialValues) -> RefusalSummary:
    """NaN and both infinities in every Real that can be set, before the run and in the midst of it, one at a time.

    Each must be refused with a sentence that names it, and leave an FMU that runs again after a reset.
    """
    wrong, tried = [], 0
    with open_session(setting.model) as it:
        for name, value, late in product(it.find_reals("parameter", "input"), (nan, inf, -inf), (False, True)):
            tried += 1
            it.reset()
            try:
                it.initialize(setting if late else replace(setting, values={**setting.values, name: value}))
                it.fmu.doStep(0.0, 0.01)
                if late:
                    it.set_values({name: value})
                    it.fmu.doStep(0.01, 0.01)
                wrong.append(f"{name} = {value} was taken{' in mid-run' * late}")
            except FMICallException:
                refusal = it.read_refusal()
                if not (refusal.message.startswith(f"{name} = ") and refusal.all_nan):
                    wrong.append(f"{name} = {value}: {refusal.message or 'no sentence'}")
        it.reset()
        it.initialize(setting)
        it.fmu.doStep(0.0, 0.01)
    return RefusalSummary(tried, tuple(wrong))
