"""The loop that steps an FMU from start to stop.

In co-simulation a step ends at the next communication point, at a jump of an input, or at `solver.t_next`, where an FMU
of this project ends its internal step. In model exchange (model_exchange.py) it ends at the next point or event.
"""

from collections.abc import Callable
from ctypes import c_double
from dataclasses import dataclass
from math import inf
from typing import Protocol

from ..errors import HarnessError
from .fmu_session import FmuSession, TerminatedError
from .inputs import InputSignals

POINT_TOLERANCE = 1e-9  # relative to the communication step; times this close coincide
EVEN_TOLERANCE = 1e-6  # relative to the communication step; the last step may differ this much from the others


@dataclass(frozen=True)
class TimeGrid:
    """Communication points from `start` to `stop` at intervals of `h`, in s; infinite for a single interval."""

    start: float
    stop: float
    h: float = inf

    @property
    def duration(self) -> float:
        """Return the time in s from start to stop."""
        return self.stop - self.start

    @property
    def tolerance(self) -> float:
        """Return the time in s within which two points coincide."""
        return POINT_TOLERANCE * self.h if self.h < inf else 0.0

    @property
    def is_even(self) -> bool:
        """Return whether the last interval is as long as the others."""
        return abs(self.start + self.whole_count * self.h - self.stop) < EVEN_TOLERANCE * self.h < inf

    @property
    def whole_count(self) -> int:
        """Return the number of intervals, rounded to the nearest integer."""
        return max(1, round(self.duration / self.h))

    @property
    def point_at(self) -> Callable[[int], float]:
        """Return a function that returns the i-th point after the start; `stop` for the last and all after it."""
        start, stop, h = self.start, self.stop, self.h
        has_remainder = start + self.whole_count * h < stop and not self.is_even
        count = self.whole_count + has_remainder
        return lambda i: stop if i >= count else start + i * h

    def progress(self, t: float) -> float:
        """Return the progress at a time, from 0 to 1."""
        return (t - self.start) / self.duration


class Stepper(Protocol):
    """Steps one session.

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
    stepper.start(t)
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
            stepper.handle_event(t)
            record(t)


class CoSimulation:
    """Steps a session for co-simulation.

    Parameters
    ----------
    session : FmuSession
    grid : TimeGrid
    signals : InputSignals, optional
        An input is constant during a step, at its value in the middle.
    next_step : c_double, optional
        Holds the recorded end of the internal step of the FMU in s, to follow it.
    only_grid : bool
        Whether steps end at points of the grid only, and have its exact size: an FMU may compare it.
    """

    def __init__(
        self,
        session: FmuSession,
        grid: TimeGrid,
        signals: InputSignals | None = None,
        next_step: c_double | None = None,
        only_grid: bool = False,
    ) -> None:
        self.session, self.grid, self.signals, self.next_step = session, grid, signals, next_step
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
                name = self.session.description.modelName
                raise HarnessError(f"{name}: solver.t_next = {target!r} s is not after t = {t!r} s")
        if self.signals:
            self.signals.apply(0.5 * (t + target))
        self.session.step(t, self.size or target - t)
        if self.signals:
            self.signals.apply(target, after_event=True)
        return target

    def handle_event(self, t: float) -> None:
        """Do nothing: events are internal to the FMU."""
