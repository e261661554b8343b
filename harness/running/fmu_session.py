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
from .fmi2 import LogCapture, initialize, load_instance, read_own_description, read_statistics, set_variable
from .trajectory import Trajectory
from .unpacking import unpack_once
from .variable_values import enumeration_labels, variable_unit

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

    def initialize(self, spec: RunSpec) -> None:
        """Set values and initialize the instance."""
        values = ((self.variables[name], value) for name, value in spec.values.items())
        initialize(self.fmu, values, spec.start or 0.0, spec.stop)

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

    def read_refusal(self) -> RefusedRun:
        """Return the error message of the FMU and the state of its outputs."""
        return RefusedRun(self.log.error_message, all(map(isnan, self.get_reals(self.find_reals("output", "local")))))

    def reset(self) -> None:
        """Reset the instance and discard its messages."""
        self.log.clear()
        self.fmu.reset()


@contextmanager
def open_session(spec: RunSpec) -> Iterator[FmuSession]:
    """Instantiate an FMU and capture its messages."""
    description = read_own_description(spec)
    with load_instance(spec, description, unpack_once(spec.fmu)) as (fmu, log):
        yield FmuSession(description, fmu, log)


def run_steps(spec: RunSpec, steps: CommunicationSteps, changes: ScheduledChanges) -> Trajectory | RefusedRun:
    """Run communication steps and record position, velocity and energy, if the FMU has one, after each.

    Parameters
    ----------
    spec : RunSpec
        FMU, values, start and stop. Without a stop, the FMU does not receive any.
    steps : list of (float, float)
        Communication steps as (start, size) in s.
    changes : dict
        Values to set at a time in s, by time.
    """
    with open_session(spec) as session:
        started = perf_counter()
        try:
            session.initialize(spec)
            rows = [session.get_reals(session.outputs)]
            for t, h in steps:
                session.set_values(changes.get(t, {}))
                session.fmu.doStep(t, h)
                rows.append(session.get_reals(session.outputs))
        except FMICallException:
            return session.read_refusal()
        seconds = perf_counter() - started
        recorded = [session.variables[name] for name in session.outputs]
        return Trajectory(
            replace(spec, outputs=session.outputs),
            np.array([spec.start or 0.0, *(t + h for t, h in steps)]),
            dict(zip(session.outputs, np.array(rows).T, strict=True)),
            {variable.name: variable_unit(variable) for variable in recorded},
            {variable.name: variable.description or variable.name for variable in recorded},
            {},
            statistics=read_statistics(session.fmu, session.variables, seconds),
        )


def inject_nonfinite(spec: RunSpec) -> RefusalSummary:
    """Set NaN and both infinities in every settable Real, before and during a run, one at a time.

    The FMU must refuse each with a message that starts with the variable's name, and must run again after a reset.
    """
    failures, n_tried = [], 0
    with open_session(spec) as session:
        for name, value, in_run in product(session.find_reals("parameter", "input"), (nan, inf, -inf), (False, True)):
            n_tried += 1
            session.reset()
            try:
                session.initialize(spec if in_run else replace(spec, values={**spec.values, name: value}))
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
        session.initialize(spec)
        session.fmu.doStep(0.0, 0.01)
    return RefusalSummary(n_tried, tuple(failures))
