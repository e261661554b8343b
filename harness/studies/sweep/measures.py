"""Measures of a sweep: at the end of a run, or along its trajectory.

A measure that is not defined for a run is NaN, such as the period of a single slip.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...analyses.decay.decrement import find_extrema_from_velocity
from ...analyses.decay.law import damping_ratio, friction_from_envelope
from ...analyses.slip import peak_value, slips_from_modes, upward_crossings
from ...errors import HarnessError
from ...scenes.roles import find_roles
from ...simulation.signals import column_of_role
from ...simulation.trajectory import Trajectory, get_parameter
from ...simulation.variable_values import variable_unit

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


def stuck(run: Trajectory) -> float:
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
    "stuck": TrajectoryMeasure(("mode",), "s", "time stuck", stuck, modes=True),
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
    measures: Iterable[str], variables: Mapping[str, Any], recorded: Iterable[str]
) -> tuple[MeasureColumn, ...]:
    """Return the columns of measures, for an FMU with these variables and recorded outputs."""
    columns: list[MeasureColumn] = []
    for measure in measures:
        if measure in OUTPUT_MEASURES:
            for name in recorded:
                variable = variables.get(name) or variables[name.partition("[")[0]]  # an array element
                text = f"{variable.description or name} {OUTPUT_MEASURES[measure][1]}"
                columns.append(MeasureColumn(f"{measure}_{name}", variable_unit(variable), text))
        elif measure == "run_time":
            columns.append(MeasureColumn("run_time", "s", "run time"))
        elif measure in FINAL_MEASURES:
            columns.append(FINAL_MEASURES[measure][0])
        else:
            declared = TRAJECTORY_MEASURES[measure]
            output = find_roles(variables).get(declared.role) if not declared.unit else None
            unit = variable_unit(variables[output]) if output else declared.unit
            columns.append(MeasureColumn(measure, unit, declared.text))
    return tuple(columns)


def measure_outputs(measure: str, outputs: Mapping[str, np.ndarray]) -> list[float]:
    """Evaluate a measure for every output."""
    return [float(OUTPUT_MEASURES[measure][0](column)) for column in outputs.values()]
