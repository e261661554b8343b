"""What is changed in a run, and what the motion must then be."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np

from .model_text import SPEED, MovingFrame

if TYPE_CHECKING:
    from .motion import FmuRuns, Motion

START_TIMES = (1.0, 1e3, 1e5, 1e6, -1e3)  # s
SCALES = (  # exponents of 2 of the units of mass, length and time
    (0, -10, 0),
    (0, -40, 0),
    (0, 40, 0),
    (0, 0, -40),
    (0, 0, 40),
    (-40, 0, 0),
    (40, 20, 10),
    (-30, -30, -20),
)
REVOLUTIONS_ADDED = (1, -100, 10_000)
LARGEST_STEPS = (1.0, 1e3, 1e6)  # of the duration; a tenth of it by default
TIME, UNITS, MIRROR, ORDER, FRAME = "start time", "units", "mirror", "order", "frame"
LARGEST_STEP, REVOLUTIONS, LONG = "largest step", "revolutions", "long run"
KINDS = (TIME, UNITS, MIRROR, ORDER, FRAME, LARGEST_STEP, REVOLUTIONS, LONG)

# tolerances relative to that of the method: another order changes roundings, another frame the error of each step
START_SLACK, ORDER_SLACK, FRAME_SLACK, LARGEST_STEP_SLACK = 10.0, 100.0, 1000.0, 1000.0
REVOLUTIONS_SLACK = 100.0  # the size of an angle, by which its first steps are controlled, is that of one radian


@dataclass(frozen=True)
class Change:
    """A change of a run that must not change its motion, apart from factors.

    Attributes
    ----------
    kind, text : str
        Symmetry to which it belongs, and the change itself.
    values : mapping
        Values to set.
    start, duration : float
        Times of the run in s.
    time_factor : float
        Duration relative to that of the original run.
    factors : mapping
        Factors of the columns; 0 for an unknown sign.
    mode_sign : int
        Factor of the modes.
    is_exact : bool
        Whether the bits must be equal, apart from the factors.
    slack : float
        Tolerance relative to that of the method.
    moving_columns : mapping
        For columns in another frame of reference: the column in the changed run, and what is added to it to get the
        original one: a number and a rate in 1/s.
    """

    kind: str
    text: str
    values: Mapping[str, Any]
    start: float
    duration: float
    time_factor: float = 1.0
    factors: Mapping[str, float] = field(default_factory=dict)
    mode_sign: int = 1
    is_exact: bool = False
    slack: float = 1.0
    moving_columns: Mapping[str, tuple[str, float, float]] = field(default_factory=dict)

    @property
    def stop(self) -> float:
        return self.start + self.duration

    def map_time(self, time: np.ndarray) -> np.ndarray:
        """Return what times in s of the original run, which starts at 0 s, become."""
        return self.start + time * self.time_factor

    def map_column(self, name: str, base: "Motion") -> np.ndarray:
        """Return what a column of the original run becomes."""
        column: np.ndarray = base.columns[name] * (self.factors.get(name, 1.0) or 1.0)
        return column

    def restore_column(self, name: str, changed_motion: "Motion") -> np.ndarray:
        """Return a column of the changed run in the frame of the original one."""
        if name not in self.moving_columns:
            return changed_motion.columns[name]
        other, offset, speed = self.moving_columns[name]
        column: np.ndarray = changed_motion.columns[other] + (
            offset + speed * (changed_motion.time - changed_motion.time[0])
        )
        return column

    def differ(self, name: str, expected: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return where values (n,) of a column are not those expected; of an unknown sign, if neither sign fits."""
        differences = expected != values
        if self.factors.get(name, 1.0) != 0.0:
            return differences
        inverted_differences = -expected != values
        return differences if differences.sum() <= inverted_differences.sum() else inverted_differences


def shift_start(values: Mapping[str, Any], duration: float, starts: Sequence[float] = START_TIMES) -> list[Change]:
    """Return changes of the start time."""
    return [Change(TIME, f"start {start:g} s", values, start, duration, slack=START_SLACK) for start in starts]


def raise_largest_step(values: Mapping[str, Any], duration: float) -> list[Change]:
    """Return changes of the largest step: as in runs that last longer, seen at their beginning."""
    steps = [factor * duration for factor in LARGEST_STEPS]
    return [
        Change(
            LARGEST_STEP,
            f"largest step {step:g} s",
            {**values, "solver.h_max": step},
            0.0,
            duration,
            slack=LARGEST_STEP_SLACK,
        )
        for step in steps
    ]


def add_revolutions(
    runs: "FmuRuns", values: Mapping[str, Any], duration: float, angles: Mapping[str, str]
) -> list[Change]:
    """Return changes by whole revolutions of each angle, by the parameter that sets its start value."""
    changes = []
    for angle, setter in angles.items():
        for n in REVOLUTIONS_ADDED:
            turn = 2.0 * pi * n
            start = values.get(setter, runs.start_value(setter)) + turn
            changes.append(
                Change(
                    REVOLUTIONS,
                    f"{angle} {n:+d} revolution{'s' * (n != 1)}",
                    {**values, setter: start},
                    0.0,
                    duration,
                    slack=REVOLUTIONS_SLACK,
                    moving_columns={angle: (angle, -turn, 0.0)},
                )
            )
    return changes


def move_to_frame(
    runs: "FmuRuns", frame: MovingFrame, base: "Motion", values: Mapping[str, Any], duration: float
) -> Change:
    """Return the change to a frame with a speed of the size of the velocities; `runs` are those in the frame."""
    speeds = np.abs([base.columns[name] for name in frame.velocities])
    speed = float(f"{np.median(speeds[speeds > 0.0]):.3g}") if speeds.any() else 1.0
    starts = {setter: float(base.columns[name][0]) - speed for name, setter in frame.start_values.items()}
    moving_columns = {name: (other, speed, 0.0) for name, other in frame.velocities.items()}
    moving_columns |= {name: (other, 0.0, speed) for name, other in frame.positions.items()}
    return Change(
        FRAME,
        f"frame at {speed:g} {runs.variables[SPEED].unit}",
        {**values, **starts, SPEED: speed},
        0.0,
        duration,
        slack=FRAME_SLACK,
        moving_columns=moving_columns,
    )


def scale_values(
    runs: "FmuRuns", values: Mapping[str, Any], scale: tuple[int, int, int]
) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the values of a run and the factors of its variables after a change of units.

    Parameters
    ----------
    runs : FmuRuns
    values : mapping
        Values that are set in the original run.
    scale : tuple of int
        Exponents of 2 of mass, length and time.
    """
    factors = {
        name: 2.0 ** sum(a * b for a, b in zip(exponents, scale, strict=True))
        for name, exponents in runs.exponents.items()
    }
    scaled_values = {
        name: values.get(name, runs.start_value(name)) * factors[name]
        for name, variable in runs.variables.items()
        if variable.causality in ("parameter", "input") and name in factors
    }
    return {**values, **scaled_values}, factors


def scale_units(runs: "FmuRuns", values: Mapping[str, Any], duration: float, scale: tuple[int, int, int]) -> Change:
    """Return the change of the units of mass, length and time by powers of 2."""
    scaled_values, factors = scale_values(runs, values, scale)
    seconds = 2.0 ** scale[2]
    text = "kg 2^{} m 2^{} s 2^{}".format(*scale)
    return Change(UNITS, text, scaled_values, 0.0, duration * seconds, seconds, factors, is_exact=True)


def invert_signs(
    runs: "FmuRuns", values: Mapping[str, Any], duration: float, odd: list[str], signs: Mapping[str, int]
) -> Change:
    """Return the change of all signs: those of the odd parameters, inputs and states."""
    inverted_values = {name: -values.get(name, runs.start_value(name)) for name in odd}
    factors = {name: float(signs.get(name, -1 if name in runs.modes else 0)) for name in runs.outputs}
    return Change(
        MIRROR, "signs inverted", {**values, **inverted_values}, 0.0, duration, 1.0, factors, -1, is_exact=True
    )
