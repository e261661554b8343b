"""Event mode: the iteration of discrete states, and the clocks of FMI 3.0.

The importer ticks time-based input clocks: it asks the FMU for their intervals, steps to each tick, and activates the
clocks in event mode. Variables that belong to clocks may be read only while one of their clocks is active. Triggered
input clocks never tick, because only another FMU could tick them.
"""

from collections.abc import Callable
from ctypes import c_bool, c_double, c_int, c_uint
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

from lxml import etree

from ..errors import HarnessError, option_text
from .fmu_archive import DESCRIPTION_FILE, describe_lenient
from .fmu_instance import FmuInstance, TerminatedError, clocks_of
from .stepping import InputSignals, TimeGrid

MAX_EVENTS = 1000  # at one time
INTERVAL_CHANGED, INTERVAL_UNKNOWN = 2, 0  # fmi3IntervalQualifier
PERIODIC, CHANGING, COUNTDOWN, TRIGGERED = ("constant", "fixed", "tunable"), "changing", "countdown", "triggered"


def update_discrete_states(update: Callable[[], tuple[bool, bool, bool, bool, bool, float]], t: float) -> float:
    """Iterate the discrete states at an event; return the time of the next event in s, inf if there is none."""
    for _ in range(MAX_EVENTS):
        needs_update, is_terminated, _, _, is_defined, next_event = update()
        if is_terminated:
            raise TerminatedError(t, "it returned terminateSimulation from an event")
        if is_defined and not next_event >= t:
            raise HarnessError(f"it sets its next event to {next_event:.9g} s, at t = {t:.9g} s")
        if not needs_update and not (is_defined and next_event == t):
            return next_event if is_defined else inf
    raise HarnessError(f"its discrete states do not settle at t = {t:.9g} s")


def check_clocks(description: Any, exchange: bool, lenient: bool) -> None:
    """Check that the clocks of an FMU can tick.

    Raises
    ------
    HarnessError
        If they cannot, and `lenient` is false.
    """
    clocks = clocks_of(description)
    if not clocks or lenient:
        return
    remedy = f"to run it without their ticks, {describe_lenient()}"
    names = ", ".join(clock.name for clock in clocks)
    if not exchange and not description.coSimulation.hasEventMode:
        other = f"use {option_text('interface', 'ModelExchange')}, or, " if description.modelExchange else ""
        raise HarnessError(f"{description.modelName} has clocks ({names}), but no event mode; {other}{remedy}")
    triggered_clocks = [
        clock.name for clock in clocks if clock.causality == "input" and clock.intervalVariability == TRIGGERED
    ]
    if triggered_clocks:
        clocks_text = f"triggered input clocks ({', '.join(triggered_clocks)})"
        raise HarnessError(f"{description.modelName} has {clocks_text}, which only another FMU can tick; {remedy}")


@dataclass
class InputClock:
    """Time-based input clock.

    Attributes
    ----------
    name, reference, kind
        Name, value reference and intervalVariability.
    base, interval : float
        The tick number n is at base + n * interval, in s; for an aperiodic clock there is tick number 0 alone.
    number : int
        Number of the next tick.
    """

    name: str
    reference: int
    kind: str
    base: float = inf
    interval: float = 0.0
    number: int = 0

    @property
    def next_tick(self) -> float:
        """Return the time of the next tick in s; inf if it is not known yet."""
        return self.base + self.number * self.interval

    def advance(self) -> None:
        """Move on to the next tick."""
        if self.kind in PERIODIC:
            self.number += 1
        else:
            self.base = inf


class Clocks:
    """Clocks of one instance of FMI 3.0, for model exchange, or co-simulation in event mode.

    Parameters
    ----------
    instance : FmuInstance
        The instance, in initialization mode.
    folder : path
        Directory of the unpacked FMU.
    start : float
        Start time in s.
    tolerance : float
        Time in s within which ticks coincide with each other and with communication points.

    Raises
    ------
    HarnessError
        If an interval is missing or not valid.
    """

    def __init__(self, instance: FmuInstance, folder: Path | str, start: float, tolerance: float) -> None:
        self.instance, self.tolerance = instance, tolerance
        self.read_values: Callable[[set[int]], object] = lambda active: None
        clocks = clocks_of(instance.description)
        self.unread = {clock.valueReference for clock in clocks}  # clocks whose variables have not been read yet
        self.outputs = [clock.valueReference for clock in clocks if clock.causality != "input"]
        kinds = (*PERIODIC, CHANGING, COUNTDOWN)
        self.inputs = [
            InputClock(clock.name, clock.valueReference, clock.intervalVariability)
            for clock in clocks
            if clock.causality == "input" and clock.intervalVariability in kinds
        ]
        root = etree.parse(str(Path(folder) / DESCRIPTION_FILE)).getroot()
        declarations = {
            int(clock.get("valueReference")): clock.attrib for clock in root.iterfind("ModelVariables/Clock")
        }
        for clock in self.inputs:
            if clock.kind in PERIODIC:
                interval, shift = self.read_period(clock, declarations[clock.reference])
                if not 0.0 < interval < inf:
                    raise HarnessError(f"its clock {clock.name} has an interval of {interval!r} s; it must be positive")
                clock.base, clock.interval = start + shift, interval
            else:
                self.read_interval(clock, start)

    @property
    def next_tick(self) -> float:
        """Return the time of the next tick in s; inf if there is none."""
        return min((clock.next_tick for clock in self.inputs), default=inf)

    def is_due(self, t: float) -> bool:
        """Return whether a clock ticks at t in s."""
        return self.next_tick <= t + self.tolerance

    def limit(self, target: float) -> float:
        """Return the time of the next tick if that is before a target in s, and else the target."""
        return target if abs(self.next_tick - target) <= self.tolerance else min(target, self.next_tick)

    def read_period(self, clock: InputClock, declaration: Any) -> tuple[float, float]:
        """Return interval and shift of a periodic clock in s, as declared, or else as the FMU states."""
        resolution = float(declaration.get("resolution", 1))
        if declaration.get("intervalDecimal") is not None:
            return float(declaration["intervalDecimal"]), float(declaration.get("shiftDecimal", 0.0))
        if declaration.get("intervalCounter") is not None:
            counters = int(declaration["intervalCounter"]), int(declaration.get("shiftCounter", 0))
            return counters[0] / resolution, counters[1] / resolution
        shift = (c_double * 1)()
        fmu = self.instance.fmu  # older versions of fmpy have methods for clocks that fail
        fmu.fmi3GetShiftDecimal(fmu.component, (c_uint * 1)(clock.reference), 1, shift)
        return self.query(clock)[0], float(shift[0])

    def query(self, clock: InputClock) -> tuple[float, int]:
        """Return the interval of a clock in s, and its qualifier."""
        interval, qualifier = (c_double * 1)(), (c_int * 1)()
        fmu = self.instance.fmu
        fmu.fmi3GetIntervalDecimal(fmu.component, (c_uint * 1)(clock.reference), 1, interval, qualifier)
        return float(interval[0]), int(qualifier[0])

    def read_interval(self, clock: InputClock, t: float) -> None:
        """Read when an aperiodic clock ticks, at t in s."""
        interval, qualifier = self.query(clock)
        if qualifier == INTERVAL_UNKNOWN and clock.kind == CHANGING:
            raise HarnessError(f"its clock {clock.name} states no interval at t = {t:.9g} s")
        if qualifier == INTERVAL_CHANGED:
            if not 0.0 <= interval < inf:
                text = f"an interval of {interval!r} s at t = {t:.9g} s; it must not be negative"
                raise HarnessError(f"its clock {clock.name} has {text}")
            clock.base = t + interval

    def handle_event(self, t: float, update: Callable[[], Any]) -> float:
        """Tick the clocks that are due at t in s, and iterate the discrete states, in event mode.

        Returns
        -------
        float
            The time of the next event of the FMU in s, which is no tick; inf if there is none.
        """
        for _ in range(MAX_EVENTS):
            due = [clock for clock in self.inputs if clock.next_tick <= t + self.tolerance]
            self.activate([clock.reference for clock in due])
            for clock in due:
                clock.advance()
            next_event = update_discrete_states(update, t)
            for clock in self.inputs:
                if clock.kind == COUNTDOWN or (clock.kind == CHANGING and clock in due):
                    self.read_interval(clock, t)
            if not self.is_due(t):
                return next_event
        raise HarnessError(f"its clocks tick without end at t = {t:.9g} s")

    def activate(self, references: list[int]) -> None:
        """Activate input clocks, and read the variables of the active clocks, also of those that the FMU activates."""
        fmu = self.instance.fmu
        if references:
            count = len(references)
            fmu.fmi3SetClock(fmu.component, (c_uint * count)(*references), count, (c_bool * count)(*[True] * count))
        count = len(self.outputs)
        states = (c_bool * count)()
        if count:
            fmu.fmi3GetClock(fmu.component, (c_uint * count)(*self.outputs), count, states)
        active = {output for output, state in zip(self.outputs, states, strict=True) if state}
        self.read_values(active | {*references} | self.unread)
        self.unread = set()


class EventCoSimulation:
    """Steps an instance for co-simulation in event mode, to the next communication point, tick or event.

    Parameters
    ----------
    instance : FmuInstance
        Instance in event mode.
    grid : TimeGrid
        Communication points.
    clocks : Clocks
        Clocks of the instance.
    signals : InputSignals, optional
        Set for each step.
    """

    def __init__(
        self, instance: FmuInstance, grid: TimeGrid, clocks: Clocks, signals: InputSignals | None = None
    ) -> None:
        self.instance, self.grid, self.clocks, self.signals = instance, grid, clocks, signals
        self.is_event, self.n_stalled = False, 0

    def start(self, t: float) -> None:
        if self.signals:
            self.signals.apply(t, after_event=True)
        self.update_states(t)

    def advance(self, t: float, target: float) -> float:
        jump = self.signals.next_jump(t) if self.signals else inf
        target = self.clocks.limit(min(target, self.next_event, jump))
        if self.signals:
            self.signals.apply_in_step(t, target)
        is_whole = abs(target - t - self.grid.h) <= self.grid.tolerance
        self.instance.step(t, self.grid.h if is_whole else target - t)
        needs_event, _, is_early, last_time = (result.value for result in self.instance.step_results)
        t_end = last_time if is_early else target
        if not t <= t_end <= target:
            raise HarnessError(
                f"fmi3DoStep returned early at {t_end!r} s, outside its step from {t!r} s to {target!r} s"
            )
        if self.signals:
            self.signals.apply(t_end)
        self.is_event = bool(needs_event) or self.clocks.is_due(t_end) or t_end >= min(self.next_event, jump)
        self.n_stalled = 0 if t_end > t else self.n_stalled + 1
        if self.n_stalled > MAX_EVENTS:
            raise HarnessError(f"{MAX_EVENTS} events in a row at t = {t_end:.9g} s")
        return t_end

    def handle_event(self, t: float) -> None:
        self.instance.fmu.enterEventMode()
        if self.signals:
            self.signals.apply(t, after_event=True)
        self.update_states(t)

    def update_states(self, t: float) -> None:
        """Tick the clocks, iterate the discrete states, and leave event mode."""
        self.next_event = self.clocks.handle_event(t, self.instance.fmu.updateDiscreteStates)
        self.instance.fmu.enterStepMode()
