"""What a sweep may measure in each run: some at its end, some along its path.

A measure that a run does not have (the period of a single slip, the rest of what still moves) is NaN.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...analyses.decay.decrement import damping_ratio, find_extrema_from_velocity, friction_from_envelope
from ...analyses.slip import peak_value, slips_from_modes, upward_crossings
from ...errors import HarnessError
from ...running.trajectory import Trajectory
from ...running.variable_values import variable_unit
from ...scenes.roles import find_roles

N_STEPS = 400  # communication steps along a path; the ends of the solver's own steps come on top


@dataclass(frozen=True)
class MeasureColumn:
    """One measured number of each run: its name, unit and sentence."""

    name: str
    unit: str
    text: str


@dataclass(frozen=True)
class TrajectoryMeasure:
    """A measure along the path.  It needs the variables named, a law with modes if it is of `modes`, and no driver if
    it is of a `decay`; `like`: the role of the output whose unit it has."""

    needs: tuple[str, ...]
    unit: str
    text: str
    measure: Callable[[Trajectory], float]
    modes: bool = False
    decay: bool = False
    like: str = ""


def starts(run: Trajectory) -> np.ndarray:
    """Times in s at which slips begin."""
    if run.events is not None:
        return slips_from_modes(run.events.t, run.events.mode)[0]
    driver = run.get_parameter("v_driver", "the measure 'slips'")
    return (
        upward_crossings(run.time, run.column_of_role("velocity") * np.sign(driver) - abs(driver))
        if driver
        else np.array([])
    )


def period(run: Trajectory) -> float:
    times = starts(run)
    return float(np.mean(np.diff(times))) if len(times) > 1 else np.nan


def peak_speed(run: Trajectory) -> float:
    speed = np.abs(run.column_of_role("velocity"))
    return peak_value(run.time, speed, np.ones(len(speed), bool))


def stuck(run: Trajectory) -> float:
    if run.events is None:
        return np.nan
    lengths = np.diff(np.append(run.events.t, run.time[-1]))
    return float(lengths[run.events.mode == 0].sum())


def rest(run: Trajectory) -> float:
    return float(run.column_of_role("position")[-1]) if run.events and run.events.mode[-1] == 0 else np.nan


def unsteady(run: Trajectory) -> float:
    driver = run.get_parameter("v_driver", "the measure 'unsteady'")
    late = run.column_of_role("velocity")[2 * run.time > run.time[0] + run.time[-1]]
    return float(np.ptp(late) / 2 / abs(driver)) if driver else np.nan


def decayed(run: Trajectory, law: Callable[[float, float, float], float]) -> float:
    """A figure from the first and the last turning point of a free decay about zero."""
    _, places = find_extrema_from_velocity(run.time, run.column_of_role("position"), run.column_of_role("velocity"))
    sizes = places * np.where(np.arange(len(places)) % 2, -1.0, 1.0) * np.sign(places[:1])
    places = sizes[sizes > 0]  # the last one may come to rest on its own side
    try:
        return law(float(places[0]), float(places[-1]), (len(places) - 1) / 2) if len(places) > 1 else np.nan
    except HarnessError:
        return np.nan


zeta = partial(decayed, law=damping_ratio)
f_over_k = partial(decayed, law=partial(friction_from_envelope, stiffness=1.0))

FINAL_MEASURES = {  # and the variable that tells it
    "events": (MeasureColumn("events", "", "changes of mode"), "events.count"),
    "steps": (MeasureColumn("steps", "", "steps of the solver"), "solver.steps"),
    "evaluations": (MeasureColumn("evaluations", "", "right-hand sides"), "solver.evaluations"),
}
DRIVER = "v_driver"
SWING = "swing of the speed in the later half, over that of the driver"
ENVELOPE = "friction over stiffness by linear envelope"
TRAJECTORY_MEASURES = {
    "slips": TrajectoryMeasure((DRIVER,), "", "slips", lambda run: float(len(starts(run)))),
    "period": TrajectoryMeasure((DRIVER,), "s", "slip period", period),
    "unsteady": TrajectoryMeasure((DRIVER,), "1", SWING, unsteady),
    "peak_speed": TrajectoryMeasure((), "", "peak speed", peak_speed, like="velocity"),
    "stuck": TrajectoryMeasure(("mode",), "s", "time stuck", stuck, modes=True),
    "rest": TrajectoryMeasure(("mode",), "", "rest position", rest, modes=True, like="position"),
    "zeta": TrajectoryMeasure(("c",), "1", "damping ratio by logarithmic decrement", zeta, decay=True),
    "f_over_k": TrajectoryMeasure(("mode",), "", ENVELOPE, f_over_k, decay=True, like="position"),
}
OUTPUT_MEASURES: dict[
    str, tuple[Callable[[np.ndarray], Any], str]
] = {  # of every output that is recorded: its measure, and in words
    "final": (lambda column: column[-1], "at the end"),
    "smallest": (np.min, "smallest at the points of the run"),
    "largest": (np.max, "largest at the points of the run"),
}
DEFAULT_MEASURES = ("final", "events")


def available_measures(variables: Collection[str], ours: bool, values: Mapping[str, object]) -> list[str]:
    """The measures that an FMU with these variables gives, with these values set; one that is not ours shows neither
    its steps nor its modes."""
    found = [*OUTPUT_MEASURES, "run_time"]
    if not ours:
        return found
    found += [name for name, (_, variable) in FINAL_MEASURES.items() if variable in variables]
    if {"position", "velocity"} <= set(find_roles(variables)):
        for name, path in TRAJECTORY_MEASURES.items():
            lawful = not path.modes or values.get("friction", "hybrid") in ("hybrid", 1)
            if lawful and set(path.needs) <= set(variables) and not (path.decay and DRIVER in variables):
                found.append(name)
    return found


def columns(
    measures: Iterable[str], variables: Mapping[str, Any], recorded: Iterable[str]
) -> tuple[MeasureColumn, ...]:
    """The columns of measures that are offered, of an FMU with these variables, of which some are recorded."""
    found: list[MeasureColumn] = []
    for measure in measures:
        if measure in OUTPUT_MEASURES:
            for name in recorded:
                variable = variables.get(name) or variables[name.partition("[")[0]]  # of an element of an array
                text = f"{variable.description or name} {OUTPUT_MEASURES[measure][1]}"
                found.append(MeasureColumn(f"{measure}_{name}", variable_unit(variable), text))
        elif measure == "run_time":
            found.append(MeasureColumn("run_time", "s", "run time"))
        elif measure in FINAL_MEASURES:
            found.append(FINAL_MEASURES[measure][0])
        else:
            path = TRAJECTORY_MEASURES[measure]
            like = find_roles(variables).get(path.like) if not path.unit else None
            found.append(MeasureColumn(measure, variable_unit(variables[like]) if like else path.unit, path.text))
    return tuple(found)


def measure_outputs(measure: str, outputs: Mapping[str, np.ndarray]) -> list[float]:
    """A measure of every output."""
    return [float(OUTPUT_MEASURES[measure][0](column)) for column in outputs.values()]
