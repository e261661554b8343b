"""Sessions with one FMU of this project: given communication steps and value changes, to the end or to an error.

Values are not checked before they are set, since studies of stability and errors also set NaN.
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
from ..scenes.run_spec import RunSpec
from .fmi2 import LogCapture, initialize, load_instance, read_own_description, set_variable
from .unpacking import unpack_once
from .variable_values import enumeration_labels

CommunicationSteps = list[tuple[float, float]]  # communication steps as (start, size) in s
ScheduledChanges = dict[float, dict[str, float]]  # values to set, by time in s


@dataclass(frozen=True)
class FmuInfo:
    """Capabilities of an FMU: methods, start values of parameters and inputs, enumerations, default stop in s."""

    methods: tuple[str, ...]
    default_method: str  # a method
    start_values: dict[str, float]
    enumerations: dict[str, dict[str, int]]
    stop: float

    def resolve_labels(self, values: dict[str, Any]) -> dict[str, float]:
        """Replace enumeration labels by numbers."""
        return {
            name: self.enumerations[name][value] if isinstance(value, str) else value for name, value in values.items()
        }


@dataclass(frozen=True)
class InitialValues:
    """Values to set before a run; `stop` is None if the importer does not provide it."""

    model: str
    values: dict[str, float]
    start: float = 0.0
    stop: float | None = None


@dataclass(frozen=True)
class RunCounts:
    """Changes of mode, accepted and rejected steps, and evaluations of the right-hand side."""

    events: int
    steps: int
    rejected: int
    evaluations: int


@dataclass(frozen=True)
class CompletedRun:
    """Completed run.

    Attributes
    ----------
    x, v, energy : numpy.ndarray
        Position, velocity and energy (n,) after each communication step, start included; no energy if the FMU has none.
    t_last : float
        Time of the last event in s; the start time without events.
    counts : RunCounts
    seconds : float
        Run time in s.
    """

    x: np.ndarray
    v: np.ndarray
    energy: np.ndarray | None
    t_last: float
    counts: RunCounts
    seconds: float


@dataclass(frozen=True)
class RefusedRun:
    """Run that the FMU refused: its message, and whether all calculated Reals are NaN."""

    message: str
    all_nan: bool


@dataclass(frozen=True)
class RefusalSummary:
    """Number of values that were tried, and a description of each failure."""

    n_tried: int
    failures: tuple[str, ...]


def read_info(model: str) -> FmuInfo:
    """Return the capabilities of a model's FMU."""
    description = read_own_description(RunSpec(find_fmu(model)))
    settable = [variable for variable in description.modelVariables if variable.causality in ("parameter", "input")]
    enumerations = {variable.name: variable for variable in settable if variable.type == "Enumeration"}
    choices = {
        name: {label: number for number, label in enumeration_labels(variable).items()}
        for name, variable in enumerations.items()
    }
    defaults = {
        variable.name: int(variable.start) if variable.name in choices else float(variable.start)
        for variable in settable
    }
    methods = {number: label for label, number in choices["solver.method"].items()}
    default = methods[int(defaults["solver.method"])]
    return FmuInfo(tuple(methods.values()), default, defaults, choices, float(description.defaultExperiment.stopTime))


class FmuSession:
    """Instance of an FMU that can be reset and run again."""

    def __init__(self, description: Any, fmu: Any, log: LogCapture) -> None:
        self.fmu, self.log = fmu, log
        self.variables = {variable.name: variable for variable in description.modelVariables}
        motion = find_roles(self.variables)
        if "velocity" not in motion:
            raise HarnessError(f"{description.modelName}: no output is declared as the derivative of a position")
        self.outputs = (motion["position"], motion["velocity"], *(["energy"] if "energy" in self.variables else []))

    def initialize(self, setting: InitialValues) -> None:
        """Set values and initialize the instance."""
        values = ((self.variables[name], value) for name, value in setting.values.items())
        initialize(self.fmu, values, setting.start, setting.stop)

    def set_values(self, values: dict[str, float]) -> None:
        """Set variables by name."""
        for name, value in values.items():
            set_variable(self.fmu, self.variables[name], value)

    def find_reals(self, *causalities: str) -> list[str]:
        """Return the names of the Reals with the given causalities."""
        return [
            variable.name
            for variable in self.variables.values()
            if variable.type == "Real" and variable.causality in causalities
        ]

    def get_reals(self, names: Iterable[str]) -> list[float]:
        """Return the values of Reals by name."""
        return self.fmu.getReal([self.variables[name].valueReference for name in names])

    def get_count(self, name: str) -> int:
        """Return an Integer; 0 if the FMU has no such variable."""
        return self.fmu.getInteger([self.variables[name].valueReference])[0] if name in self.variables else 0

    def read_refusal(self) -> RefusedRun:
        """Return the error message of the FMU and the state of its outputs."""
        return RefusedRun(self.log.error_message, all(map(isnan, self.get_reals(self.find_reals("output", "local")))))

    def reset(self) -> None:
        """Reset the instance and discard its messages."""
        self.log.clear()
        self.fmu.reset()


@contextmanager
def open_session(model: str) -> Iterator[FmuSession]:
    """Instantiate a model's FMU and capture its messages."""
    spec = RunSpec(find_fmu(model))
    description = read_own_description(spec)
    with load_instance(spec, description, unpack_once(spec.fmu)) as (fmu, log):
        yield FmuSession(description, fmu, log)


def run_steps(
    setting: InitialValues, calls: CommunicationSteps, changes: ScheduledChanges
) -> CompletedRun | RefusedRun:
    """Run communication steps and record states after each.

    Parameters
    ----------
    setting : InitialValues
    calls : list of (float, float)
        Communication steps as (start, size) in s.
    changes : dict
        Values to set at a time in s, by time.
    """
    with open_session(setting.model) as session:
        started = perf_counter()
        try:
            session.initialize(setting)
            rows = [session.get_reals(session.outputs)]
            for t, h in calls:
                session.set_values(changes.get(t, {}))
                session.fmu.doStep(t, h)
                rows.append(session.get_reals(session.outputs))
        except FMICallException:
            return session.read_refusal()
        seconds = perf_counter() - started
        x, v, *energy = np.array(rows).T
        t_last = session.get_reals(["events.t_last"])[0] if "events.t_last" in session.variables else setting.start
        counts = [
            session.get_count(name)
            for name in ("events.count", "solver.steps", "solver.rejected", "solver.evaluations")
        ]
        return CompletedRun(x, v, energy[0] if energy else None, t_last, RunCounts(*counts), seconds)


def inject_nonfinite(setting: InitialValues) -> RefusalSummary:
    """Set NaN and both infinities in every settable Real, before and during a run, one at a time.

    The FMU must refuse each with a message that starts with the variable's name, and must run again after a reset.
    """
    failures, n_tried = [], 0
    with open_session(setting.model) as session:
        for name, value, in_run in product(session.find_reals("parameter", "input"), (nan, inf, -inf), (False, True)):
            n_tried += 1
            session.reset()
            try:
                session.initialize(setting if in_run else replace(setting, values={**setting.values, name: value}))
                session.fmu.doStep(0.0, 0.01)
                if in_run:
                    session.set_values({name: value})
                    session.fmu.doStep(0.01, 0.01)
                failures.append(f"{name} = {value} was accepted{' during the run' * in_run}")
            except FMICallException:
                refusal = session.read_refusal()
                if not (refusal.message.startswith(f"{name} = ") and refusal.all_nan):
                    failures.append(f"{name} = {value}: {refusal.message or 'no sentence'}")
        session.reset()
        session.initialize(setting)
        session.fmu.doStep(0.0, 0.01)
    return RefusalSummary(n_tried, tuple(failures))
