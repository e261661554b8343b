"""The loop that steps an FMU from start to stop, and the input signals that it sets.

In co-simulation a step ends at the next communication point, at a jump of an input, or at `solver.t_next`, where an FMU
of this project ends its internal step. In model exchange (model_exchange.py) it ends at the next point or event. Input
signals are a table over time, linear between its rows.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from ctypes import c_double
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from ..errors import HarnessError, SceneError, check_names, format_value
from ..scenes.run_spec import RunSpec
from .fmu_instance import FmuInstance, TerminatedError
from .model_data import read_model_data
from .variable_values import REAL_TYPES

Inputs = Mapping[str, Sequence[float] | np.ndarray]  # "time" in s, and the values of each input at these times

TIME = "time"
POINT_TOLERANCE = 1e-9  # relative to the communication step; times this close coincide
EVEN_TOLERANCE = 1e-6  # relative to the communication step; the last step may differ this much from the others
# An interval of a table has a kink if its slope differs from the rate by this share of the change of the rate, and by
# this many times what it differs in most intervals. More than a share of such intervals are no kinks.
KINK_SHARE, KINK_GAP, MAX_KINKS = 0.25, 20.0, 0.1
ROUNDING = 1e-9  # of the largest rate


@dataclass(frozen=True)
class TimeGrid:
    """Communication points from `start` to `stop` at intervals of `h`, in s; infinite for a single interval.

    There are further points at the increasing `times`, in place of points of the intervals that coincide with them.
    """

    start: float
    stop: float
    h: float = inf
    times: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def duration(self) -> float:
        """Return the time in s from start to stop."""
        return self.stop - self.start

    @cached_property
    def tolerance(self) -> float:
        """Return the time in s within which two points coincide."""
        if len(self.times):
            return POINT_TOLERANCE * min(self.h, shortest_interval(self.times, self.duration))
        return POINT_TOLERANCE * self.h if self.h < inf else 0.0

    @property
    def is_even(self) -> bool:
        """Return whether all intervals are as long as `h`."""
        return self.has_whole_intervals and not len(self.times)

    @property
    def has_whole_intervals(self) -> bool:
        """Return whether the run is a multiple of `h`."""
        return abs(self.start + self.whole_count * self.h - self.stop) < EVEN_TOLERANCE * self.h < inf

    @property
    def whole_count(self) -> int:
        """Return the number of intervals `h`, rounded to the nearest integer."""
        return max(1, round(self.duration / self.h))

    @property
    def count(self) -> int:
        """Return the number of intervals `h`, and of a shorter one at the end if there is one."""
        has_remainder = self.start + self.whole_count * self.h < self.stop and not self.has_whole_intervals
        return self.whole_count + has_remainder

    @cached_property
    def points(self) -> np.ndarray:
        """Return all points (n,) in s."""
        first, end = np.searchsorted(self.times, [self.start + self.tolerance, self.stop - self.tolerance])
        points = np.concatenate([[self.start], self.times[first:end], [self.stop]])
        return merge_points(points, self.start + self.h * np.arange(1, self.count), self.tolerance)

    @property
    def point_at(self) -> Callable[[int], float]:
        """Return a function that returns the i-th point after the start; `stop` for the last and all after it."""
        start, stop, h, count = self.start, self.stop, self.h, self.count
        if len(self.times):
            points, last = self.points.tolist(), len(self.points) - 1
            return lambda i: points[min(i, last)]
        return lambda i: stop if i >= count else start + i * h

    def progress(self, t: float) -> float:
        """Return the progress at a time, from 0 to 1."""
        return (t - self.start) / self.duration


def shortest_interval(times: np.ndarray, single: float = inf) -> float:
    """Return the shortest interval in s between increasing times (n,), or `single` without an interval."""
    return float(np.diff(times).min(initial=single))


def merge_points(points: np.ndarray, others: np.ndarray, tolerance: float) -> np.ndarray:
    """Return increasing points in s and those of increasing others that are farther than a tolerance in s from them."""
    if not len(others):
        return points
    neighbours = np.concatenate([[-inf], points, [inf]])
    after = np.searchsorted(points, others)
    gap = np.minimum(others - neighbours[after], neighbours[after + 1] - others)
    return np.sort(np.concatenate([points, others[gap > tolerance]]))


def make_grid(spec: RunSpec, start: float, stop: float) -> TimeGrid:
    """Return the communication points of a run from start to stop in s, with those that its `times` add.

    Raises
    ------
    SceneError
        If the times do not increase or are outside the run.
    """
    equal_step = (stop - start) / spec.equal_steps if spec.equal_steps else inf
    h = spec.grid or equal_step or inf  # equal steps of the shortest times underflow to zero
    times = np.asarray(spec.times, dtype=float)
    if not len(times):
        return TimeGrid(start, stop, h)
    shortest = shortest_interval(times, stop - start)
    if not shortest > 0.0:
        raise SceneError("times must increase: sort them, and remove those that occur twice")
    for t in times[[0, -1]].tolist():
        if not start <= t <= stop:
            raise SceneError(f"times has {t!r} s, outside the run from {start!r} s to {stop!r} s")
    if TIME in spec.inputs:
        rows = np.unique(np.asarray(spec.inputs[TIME], dtype=float))
        times = merge_points(times, rows[(start < rows) & (rows < stop)], POINT_TOLERANCE * shortest)
    return TimeGrid(start, stop, h, times)


class Stepper(Protocol):
    """Steps one instance.

    Attributes
    ----------
    is_event : bool
        Whether the last step ended at an event.
    """

    is_event: bool

    def start(self, t: float) -> None:
        """Prepare the first step; t in s."""

    def advance(self, t: float, target: float) -> float:
        """Step from t towards the target, and return the time that is reached, in s."""

    def handle_event(self, t: float) -> None:
        """Handle an event at t, in s."""


def step_to_stop(
    stepper: Stepper,
    grid: TimeGrid,
    record: Callable[[float], object],
    report: Callable[[float], object],
    report_every: int = 1,
) -> None:
    """Step from start to stop and record every point that is reached, and again after an event.

    Parameters
    ----------
    stepper : Stepper
    grid : TimeGrid
    record : callable
        Receives the time in s.
    report : callable
        Receives the progress of the run, from 0 to 1, at every `report_every`-th step.

    Raises
    ------
    TerminatedError
        If the FMU terminates the simulation. The point of that time is recorded.
    """
    stop, tolerance, point_at = grid.stop, grid.tolerance, grid.point_at
    t, target, point, n_steps = grid.start, point_at(1), 1, 0
    call_recorded(stepper.start, t, record)
    record(t)
    while t < stop:
        if n_steps % report_every == 0:
            report(grid.progress(t))
        n_steps += 1
        while target <= t + tolerance and target < stop:
            point += 1
            target = point_at(point)
        try:
            t = stepper.advance(t, target)
        except TerminatedError as error:  # at any time that the FMU reports
            if error.t is not None and t < error.t < target + EVEN_TOLERANCE * (target - t):
                record(error.t)
            raise
        record(t)
        if stepper.is_event:
            call_recorded(stepper.handle_event, t, record)
            record(t)


def call_recorded(handle: Callable[[float], object], t: float, record: Callable[[float], object]) -> None:
    """Handle an event at t in s; if it terminates the simulation, record its values before the exception propagates."""
    try:
        handle(t)
    except TerminatedError:
        record(t)
        raise


def check_inputs(inputs: Inputs, variables: Mapping[str, Any], values: Mapping[str, Any]) -> None:
    """Check a table of input signals against the variables of an FMU.

    Parameters
    ----------
    inputs : mapping
        The column ``time`` in s, which does not fall, and a column for each input. A time that occurs twice is a jump.
    variables : mapping
        The variables of the model description by name.
    values : mapping
        The values of the run, which set no input that has a column.

    Raises
    ------
    SceneError
        If a column is missing, unknown, not finite or of another length, or an input has a value as well.
    """
    if not inputs:
        return
    if TIME not in inputs:
        raise SceneError("inputs has no column 'time': add the times in s, as in {'time': [0, 1], 'F_ext': [0, 5]}")
    names = [
        name for name, variable in variables.items() if variable.causality == "input" and variable.type in REAL_TYPES
    ]
    check_names("input", [name for name in inputs if name != TIME], [name for name in names if name != TIME])
    rows = len(inputs[TIME])
    for name, column in inputs.items():
        if name in values and name != TIME:
            raise SceneError(f"{name} = {format_value(values[name])} and inputs has a column {name}: remove one")
        if len(column) != rows or not rows:
            raise SceneError(f"inputs: {name} has {len(column)} values for {rows} times; give one for each time")
        if not np.isfinite(np.asarray(column, dtype=float)).all():
            raise SceneError(f"inputs: {name} holds a value that is not a finite number")
    if (np.diff(inputs[TIME]) < 0).any():
        raise SceneError("inputs: the time falls; sort the rows by time")


def check_rates(fmu: Path, inputs: Inputs, values: Mapping[str, Any]) -> None:
    """Check that the inputs or values of a run have the declared rate of each input that varies between jumps.

    Raises
    ------
    SceneError
        If a rate is missing.
    """
    time = np.asarray(inputs.get(TIME, ()), dtype=float)
    for name, rate_inputs in read_model_data(fmu).rate_inputs.items() if inputs else ():
        missing_rates = [rate for rate in rate_inputs if rate not in inputs and rate not in values]
        if name in inputs and missing_rates and (np.diff(inputs[name])[np.diff(time) > 0] != 0).any():
            raise SceneError(
                f"inputs: {name} varies, but {missing_rates[0]} is missing, the rate by which the FMU continues it: "
                f"add a column for {missing_rates[0]}, or let {name} jump at times that occur twice"
            )


def split_kinks(inputs: Inputs, rate_inputs: Mapping[str, Sequence[str]]) -> tuple[dict[str, np.ndarray], str]:
    """Return inputs in which a rate jumps at a kink of its input, and a sentence; empty if no kink lacks a row.

    A kink needs two rows of one time: between rows a rate is interpolated, and with one row it is no longer the slope
    of its input. There the slope counts.

    Parameters
    ----------
    inputs : mapping
        The table, as `check_inputs` describes it.
    rate_inputs : mapping
        Names of the inputs on which the declared rate of an input depends. If it is only one, and the slope agrees with
        it in most intervals, the rate is that input itself.
    """
    time = np.asarray(inputs.get(TIME, ()), dtype=float)
    columns = {name: np.asarray(column, dtype=float) for name, column in inputs.items() if name != TIME}
    begin = {name: column[:-1].copy() for name, column in columns.items()}
    end = {name: column[1:].copy() for name, column in columns.items()}
    intervals, notes = np.diff(time), []
    moves = intervals > 0
    for name, rates in rate_inputs.items():
        if len(rates) != 1 or name not in columns or rates[0] not in columns or not moves.any():
            continue
        rate = columns[rates[0]]
        slope = np.divide(np.diff(columns[name]), intervals, out=np.zeros(len(intervals)), where=moves)
        gap = np.where(moves, np.abs(slope - (rate[:-1] + rate[1:]) / 2), 0.0)
        min_gap = max(KINK_GAP * np.quantile(gap[moves], 0.25, method="lower"), ROUNDING * np.abs(rate).max())
        is_kink = (gap > KINK_SHARE * np.abs(np.diff(rate))) & (gap > min_gap)
        if not 0 < is_kink.sum() <= max(2, MAX_KINKS * len(is_kink)):
            continue
        begin[rates[0]][is_kink] = end[rates[0]][is_kink] = slope[is_kink]
        first = int(np.argmax(is_kink))
        notes.append(
            f"{name} and its rate {rates[0]} disagree in {is_kink.sum()} of {len(is_kink)} intervals, first from t = "
            f"{time[first]:.6g} to {time[first + 1]:.6g} s: the slope of {name} is used there; write two rows of one "
            "time at a kink"
        )
    if not notes:
        return {}, ""
    split_inputs = {TIME: np.repeat(time, 2)[1:-1]} | {
        name: np.column_stack([begin[name], end[name]]).ravel() for name in columns
    }
    return split_inputs, "; ".join(notes)


def values_of_steps(inputs: Inputs, points: np.ndarray, continued_inputs: Collection[str] = ()) -> np.ndarray:
    """Return the inputs (n, inputs) of a run: those at the start, and one row for each step.

    Parameters
    ----------
    inputs : mapping
        The table, as `check_inputs` describes it.
    points : numpy.ndarray
        Communication points (n,) in s; all times of the table in between are among them.
    continued_inputs : collection of str
        Inputs that the FMU continues by their rate from the value at the start of a step; others have the mean of both
        ends.
    """
    begin, end = ends_of_steps(inputs, points)
    is_continued = np.array([name in continued_inputs for name in inputs if name != TIME], dtype=bool)
    return np.concatenate([begin[:1], np.where(is_continued, begin, 0.5 * (begin + end))])


def ramps_of_steps(inputs: Inputs, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the inputs (n, inputs) at the start of a run and of each step, and their slopes (n, inputs) in a step.

    The parameters are those of `values_of_steps`.
    """
    begin, end = ends_of_steps(inputs, points)
    slopes = (end - begin) / np.diff(points)[:, None]
    return np.concatenate([begin[:1], begin]), np.concatenate([np.zeros_like(slopes[:1]), slopes])


def ends_of_steps(inputs: Inputs, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the inputs (n - 1, inputs) at the start and at the end of each step between the points (n,) in s."""
    time = np.asarray(inputs.get(TIME, ()), dtype=float)
    columns = [np.asarray(column, dtype=float) for name, column in inputs.items() if name != TIME]
    ends = np.empty((2, len(points) - 1, len(columns)))
    for j, column in enumerate(columns):
        ends[0, :, j] = interpolate(time, column, points[:-1], "right")
        ends[1, :, j] = interpolate(time, column, points[1:], "left")
    return ends[0], ends[1]


def interpolate(time: np.ndarray, column: np.ndarray, points: np.ndarray, side: Literal["left", "right"]) -> np.ndarray:
    """Return a column over time (n,) in s at points (m,) in s; at a jump the value on its left or right side."""
    after = np.searchsorted(time, points, side)
    before, after = np.maximum(after - 1, 0), np.minimum(after, len(time) - 1)
    interval = time[after] - time[before]  # 0 before and after the table
    share = np.divide(points - time[before], interval, out=np.zeros(len(points)), where=interval > 0)
    values: np.ndarray = (1.0 - share) * column[before] + share * column[after]
    return values


def input_signals(spec: RunSpec, instance: FmuInstance) -> "InputSignals | None":
    """Return what sets the inputs of an instance, None without input signals."""
    has_signals = any(name != TIME for name in spec.inputs)
    return InputSignals(spec.inputs, instance, read_model_data(spec.fmu).rate_inputs) if has_signals else None


class InputSignals:
    """Sets the inputs of an FMU instance from a table.

    In co-simulation an FMU that interpolates inputs receives value and slope at the start of a step. Otherwise an input
    is constant within a communication step: its value in the middle of the step makes the error of a smooth motion of
    second order in the step, and shifts an event by up to half a step. An input whose rate the model declares is
    continued by the FMU, from its value at the start of the step.

    Parameters
    ----------
    inputs : mapping
        The table, as `check_inputs` describes it.
    instance : FmuInstance
        The instance.
    continued_inputs : collection of str
        Inputs with a declared rate.

    Raises
    ------
    HarnessError
        If the inputs are of several types.
    """

    def __init__(self, inputs: Inputs, instance: FmuInstance, continued_inputs: Collection[str] = ()) -> None:
        variables = [instance.variables[name] for name in inputs if name != TIME]
        kinds = {variable.type for variable in variables}
        if len(kinds) > 1:
            raise HarnessError(f"inputs of several types ({', '.join(sorted(kinds))}) cannot be driven at once")
        self.set_values = getattr(instance.fmu, f"set{kinds.pop()}")
        self.references = [variable.valueReference for variable in variables]
        self.time = np.asarray(inputs[TIME], dtype=float)
        self.columns = [np.asarray(column, dtype=float) for name, column in inputs.items() if name != TIME]
        self.is_continued = [name in continued_inputs for name in inputs if name != TIME]
        cosimulation = instance.description.coSimulation
        has_ranges = any(variable.min is not None or variable.max is not None for variable in variables)
        self.interpolates = (
            instance.description.fmiVersion == "2.0"
            and cosimulation is not None
            and cosimulation.canInterpolateInputs
            and not has_ranges  # which a slope may leave
        )
        self.fmu = instance.fmu
        self.jumps = self.time[1:][np.diff(self.time) == 0]

    def apply(self, time: float, continuous: bool = True, discrete: bool = True, after_event: bool = False) -> None:
        """Set the inputs at a time in s; at a jump the value before it, or after it if `after_event`.

        The signature is that of fmpy's Input, whose place this class takes in fmpy's solvers.
        """
        i = int(np.searchsorted(self.time, time, side="right" if after_event else "left"))
        self.set_values(self.references, [self.value(column, i, time) for column in self.columns])

    def apply_in_step(self, start: float, end: float) -> None:
        """Set the inputs for a step in s: by value and slope, or in the middle unless the FMU continues them."""
        middle = 0.5 * (start + end)
        first = int(np.searchsorted(self.time, start, side="right"))
        if self.interpolates:
            last = int(np.searchsorted(self.time, end, side="left"))
            values = [self.value(column, first, start) for column in self.columns]
            ends = [self.value(column, last, end) for column in self.columns]
            slopes = [(after - before) / (end - start) for before, after in zip(values, ends, strict=True)]
            self.set_values(self.references, values)
            self.fmu.setRealInputDerivatives(self.references, [1] * len(values), slopes)
            return
        i = int(np.searchsorted(self.time, middle, side="left"))
        pairs = zip(self.columns, self.is_continued, strict=True)
        self.set_values(
            self.references,
            [
                self.value(column, first, start) if at_start else self.value(column, i, middle)
                for column, at_start in pairs
            ],
        )

    def value(self, column: np.ndarray, i: int, time: float) -> float:
        """Interpolate a column at a time in s, which lies between the rows i - 1 and i."""
        if i == 0 or i == len(self.time):
            return float(column[min(i, len(column) - 1)])
        before, after = self.time[i - 1 : i + 1].tolist()
        share = (time - before) / (after - before)
        return float((1.0 - share) * column[i - 1] + share * column[i])

    def next_jump(self, time: float) -> float:
        """Return the time in s of the first jump after a time, inf if there is none."""
        later = self.jumps[self.jumps > time]
        return float(later[0]) if len(later) else inf


class CoSimulation:
    """Steps an instance for co-simulation.

    Parameters
    ----------
    instance : FmuInstance
    grid : TimeGrid
    signals : InputSignals, optional
        Set for each step.
    next_step : c_double, optional
        Holds the recorded end of the internal step of the FMU in s, to follow it.
    only_grid : bool
        Whether steps end at points of the grid only, and have its exact size: an FMU may compare it.
    """

    def __init__(
        self,
        instance: FmuInstance,
        grid: TimeGrid,
        signals: InputSignals | None = None,
        next_step: c_double | None = None,
        only_grid: bool = False,
    ) -> None:
        self.instance, self.grid, self.signals, self.next_step = instance, grid, signals, next_step
        self.is_event = False
        self.only_grid, self.tolerance = only_grid, grid.tolerance
        self.size = grid.h if only_grid and grid.is_even else None

    def start(self, t: float) -> None:
        if self.signals:
            self.signals.apply(t, after_event=True)

    def advance(self, t: float, target: float) -> float:
        if self.signals and not self.only_grid:
            target = min(target, self.signals.next_jump(t))
        if self.next_step is not None:
            end = self.next_step.value
            # an input that was set at an event restarts the solver there, up to a rounding before it
            is_passed = self.signals is not None and end <= t + self.tolerance
            if end <= target + self.tolerance and not is_passed:
                target = min(end, self.grid.stop)
            if not target > t:
                name = self.instance.description.modelName
                raise HarnessError(f"{name}: solver.t_next = {target!r} s is not after t = {t!r} s")
        if self.signals:
            self.signals.apply_in_step(t, target)
        self.instance.step(t, self.size or target - t)
        if self.signals:
            self.signals.apply(target, after_event=True)
        return target

    def handle_event(self, t: float) -> None:
        """Do nothing: events are internal to the FMU."""
