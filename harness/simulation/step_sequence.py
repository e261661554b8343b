"""Runs of an FMU of this project with given communication steps and changes of values, to the end or to an error.

Values are set without a check, because studies of stability and errors also set NaN.
"""

import io
from dataclasses import dataclass, replace
from itertools import product
from math import inf, isnan, nan
from time import perf_counter
from typing import Any

from ..errors import HarnessError
from ..scenes.roles import find_roles
from ..scenes.run_spec import RunSpec
from .fmu_archive import unpack_once
from .fmu_instance import CALL_FAILURES, FmuInstance
from .recorder import Recorder, ShapedVariable, read_rows
from .runner import open_instance
from .session import read_statistics
from .trajectory import Trajectory
from .variable_values import REAL_TYPES, variable_unit

CommunicationSteps = list[tuple[float, float]]  # communication steps as (start, size) in s
ScheduledChanges = dict[float, dict[str, float]]  # values to set, by time in s


@dataclass(frozen=True)
class RefusedRun:
    """Run that the FMU refused: its message, and whether all calculated Reals are NaN."""

    message: str
    all_nan: bool


@dataclass(frozen=True)
class RefusalSummary:
    """Number `n_tried` of invalid values that were set, and a description of each failure."""

    n_tried: int
    failures: tuple[str, ...]


def initialize(instance: FmuInstance, spec: RunSpec) -> None:
    """Set the values of a run and initialize the instance."""
    instance.initialize(settings(instance, spec.values), spec.start or 0.0, spec.stop)


def settings(instance: FmuInstance, values: dict[str, float]) -> list[tuple[Any, float]]:
    """Return pairs of variable and value, from values by name; a choice that the build fixed is no variable."""
    pairs = [(instance.variables[name], value) for name, value in values.items() if name in instance.variables]
    return [(variable, value if variable.type in REAL_TYPES else int(value)) for variable, value in pairs]


def set_values(instance: FmuInstance, values: dict[str, float]) -> None:
    """Set variables by name."""
    for variable, value in settings(instance, values):
        instance.set(variable, value)


def find_reals(instance: FmuInstance, *causalities: str) -> list[str]:
    """Return the names of the Reals with the given causalities."""
    return [
        name
        for name, variable in instance.variables.items()
        if variable.type in REAL_TYPES and variable.causality in causalities
    ]


def find_outputs(instance: FmuInstance) -> tuple[str, ...]:
    """Return position, velocity and, if the FMU has it, energy."""
    motion = find_roles(instance.variables)
    if "velocity" not in motion:
        raise HarnessError(f"{instance.description.modelName}: no output is declared as the derivative of a position")
    return (motion["position"], motion["velocity"], *(["energy"] if "energy" in instance.variables else []))


def read_refusal(instance: FmuInstance) -> RefusedRun:
    """Return the error message of the FMU and the state of its outputs."""
    values = [instance.get(name) for name in find_reals(instance, "output", "local")]
    return RefusedRun(instance.log.error_message, all(map(isnan, values)))


def run_steps(spec: RunSpec, steps: CommunicationSteps, changes: ScheduledChanges) -> Trajectory | RefusedRun:
    """Run communication steps and record position, velocity and energy, if the FMU has one, after each.

    Parameters
    ----------
    spec : RunSpec
        FMU, values, start and stop. The stop may be missing; then the FMU receives none.
    steps : list of (float, float)
        Communication steps as (start, size) in s.
    changes : dict
        Values to set at a time in s, by time.
    """
    with open_instance(spec, unpack_once(spec.fmu)) as instance:
        outputs, rows = find_outputs(instance), io.BytesIO()
        variables = [instance.variables[name] for name in outputs]
        selection: list[ShapedVariable] = [(variable, ()) for variable in variables]
        recorder = Recorder(instance, selection, rows.write)
        start_time = perf_counter()
        try:
            initialize(instance, spec)
            recorder.record(spec.start or 0.0)
            for t, h in steps:
                set_values(instance, changes.get(t, {}))
                instance.step(t, h)
                recorder.record(t + h)
        except CALL_FAILURES:
            return read_refusal(instance)
        seconds = perf_counter() - start_time
        return Trajectory(
            *read_rows(rows.getbuffer(), selection, instance.is_fmi2),
            {variable.name: variable_unit(variable) for variable in variables},
            {variable.name: variable.description or variable.name for variable in variables},
            spec=replace(spec, outputs=outputs),
            statistics=read_statistics(instance, seconds),
        )


def inject_nonfinite(spec: RunSpec) -> RefusalSummary:
    """Set NaN and both infinities in every settable Real, before and during a run, one at a time.

    The FMU must refuse each with a message that starts with the variable's name, and must run again after a reset.
    """
    failures, n_tried = [], 0
    with open_instance(spec, unpack_once(spec.fmu)) as instance:
        for name, value, in_run in product(find_reals(instance, "parameter", "input"), (nan, inf, -inf), (False, True)):
            n_tried += 1
            instance.reset()
            try:
                initialize(instance, spec if in_run else replace(spec, values={**spec.values, name: value}))
                instance.step(0.0, 0.01)
                if in_run:
                    set_values(instance, {name: value})
                    instance.step(0.01, 0.01)
                failures.append(f"{name} = {value} was accepted{' during the run' * in_run}")
            except CALL_FAILURES:
                refusal = read_refusal(instance)
                if not (refusal.message.startswith(f"{name} = ") and refusal.all_nan):
                    failures.append(f"{name} = {value}: {refusal.message or 'no sentence'}")
        instance.reset()
        initialize(instance, spec)
        instance.step(0.0, 0.01)
    return RefusalSummary(n_tried, tuple(failures))
