"""What a sweep may measure in each run: some at its end, some along its path.

A measure that a run does not have (the period of a single slip, the rest of what still moves) is NaN.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...analyses.decay.decrement import damping_ratio, friction, turning_points
from ...analyses.slip import crest, crossings, slips_of_modes
from ...errors import HarnessError, SceneError, unknown
from ...running.run import Run
from ...scenes.roles import roles

PIECES = 400  # communication steps along a path; the ends of the solver's own steps come on top


@dataclass(frozen=True)
class Column:
    """One measured number of each run: its name, unit and sentence."""

    name: str
    unit: str
    text: str


@dataclass(frozen=True)
class AlongPath:
    """A measure along the path; it needs the `variable` in the FMU."""

    variable: str
    unit: str
    text: str
    measure: Callable[[Run], float]


def starts(run: Run) -> np.ndarray:
    """Times in s at which slips begin."""
    if run.events is not None:
        return slips_of_modes(run.events.t, run.events.mode)[0]
    driver = run.parameter("v_driver", "the measure 'slips'")
    return crossings(run.time, run.motion("velocity") * np.sign(driver) - abs(driver)) if driver else np.array([])


def period(run: Run) -> float:
    times = starts(run)
    return float(np.mean(np.diff(times))) if len(times) > 1 else np.nan


def peak_speed(run: Run) -> float:
    speed = np.abs(run.motion("velocity"))
    return crest(run.time, speed, np.ones(len(speed), bool))


def stuck(run: Run) -> float:
    if run.events is None:
        return np.nan
    lengths = np.diff(np.append(run.events.t, run.time[-1]))
    return float(lengths[run.events.mode == 0].sum())


def rest(run: Run) -> float:
    return float(run.motion("position")[-1]) if run.events and run.events.mode[-1] == 0 else np.nan


def unsteady(run: Run) -> float:
    driver = run.parameter("v_driver", "the measure 'unsteady'")
    late = run.motion("velocity")[2 * run.time > run.time[0] + run.time[-1]]
    return float(np.ptp(late) / 2 / abs(driver)) if driver else np.nan


def decayed(run: Run, law: Callable[[float, float, float], float]) -> float:
    """A figure from the first and the last turning point of a free decay about zero."""
    _, places = turning_points(run.time, run.motion("position"), run.motion("velocity"))
    sizes = places * np.where(np.arange(len(places)) % 2, -1.0, 1.0) * np.sign(places[:1])
    places = sizes[sizes > 0]  # the last one may come to rest on its own side
    try:
        return law(float(places[0]), float(places[-1]), (len(places) - 1) / 2) if len(places) > 1 else np.nan
    except HarnessError:
        return np.nan


def zeta(run: Run) -> float:
    return decayed(run, damping_ratio)


def f_over_k(run: Run) -> float:
    return decayed(run, lambda x_0, x_n, cycles: friction(x_0, x_n, cycles, 1.0))


AT_END = {  # and the variable that tells it
    "events": (Column("events", "", "changes of mode"), "events.count"),
    "steps": (Column("steps", "", "steps of the solver"), "solver.steps"),
    "evaluations": (Column("evaluations", "", "right-hand sides"), "solver.evaluations"),
}
ON_PATH = {
    "slips": AlongPath("v_driver", "", "slips", lambda run: float(len(starts(run)))),
    "period": AlongPath("v_driver", "s", "slip period", period),
    "unsteady": AlongPath("v_driver", "1", "swing of the speed in the later half, over that of the driver", unsteady),
    "peak_speed": AlongPath("solver.steps", "", "peak speed", peak_speed),
    "stuck": AlongPath("mode", "s", "time stuck", stuck),
    "rest": AlongPath("mode", "", "rest position", rest),
    "zeta": AlongPath("solver.steps", "1", "damping ratio by logarithmic decrement", zeta),
    "f_over_k": AlongPath("solver.steps", "", "friction over stiffness by linear envelope", f_over_k),
}
LIKE = {"peak_speed": "velocity", "rest": "position", "f_over_k": "position"}  # measured in the unit of


def columns(measures: tuple[str, ...], variables: dict[str, Any]) -> tuple[Column, ...]:
    """The columns of these measures, for an FMU with these variables; SceneError for what it does not offer."""
    offered = ["final", "run_time", *(name for name, (_, variable) in AT_END.items() if variable in variables)]
    offered += [name for name, path in ON_PATH.items() if path.variable in variables]
    found: list[Column] = []
    for measure in measures:
        if measure not in offered:
            raise SceneError(unknown("measure", measure, offered))
        if measure == "final":
            for role in ("position", "velocity"):
                name = roles(variables)[role]
                found.append(Column(f"final_{name}", variables[name].unit, f"{variables[name].description} at the end"))
        elif measure == "run_time":
            found.append(Column("run_time", "s", "run time"))
        elif measure in AT_END:
            found.append(AT_END[measure][0])
        else:
            path = ON_PATH[measure]
            like = roles(variables).get(LIKE.get(measure, ""))
            found.append(Column(measure, variables[like].unit if like else path.unit, path.text))
    return tuple(found)
