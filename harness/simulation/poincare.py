"""Return maps of an oscillator, and its periodic orbits.

An orbit of period T from states y solves R (Y(T; y) - y) = 0 with the reduction R of oscillator.py, by Newton's method
with the derivatives of Y through all events. The eigenvalues of R Y_y B, with the basis B, are its Floquet multipliers;
that of the direction of motion, which is 1 without a force, is left out. An orbit that sticks has a multiplier zero: a
cycle from one end of sticking to the next is exact.

References
----------
R. I. Leine, D. H. van Campen, B. L. van de Vrande, Bifurcations in nonlinear discontinuous systems, Nonlinear Dynamics
23 (2000) 105-164.
"""

from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from math import inf, nan
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ..errors import HarnessError
from .motion import NEUTRAL, SLIDING_ORBIT, STICK_SLIP, Motion
from .oscillator import MAX_ITERATIONS, Oscillator, Point, SteadySliding

REPEATS = 1e-9  # relative difference of states that repeat
SETTLED_DISTANCE = 1e-3  # of the first distance to steady sliding
COLLAPSED_RATE = 1e-4  # share of the first rates at which an orbit has shrunk to steady sliding
CLOSURE_ERROR = 1e-8  # relative difference of the ends of an orbit
MAX_TURNS = 64  # without sticking
RETURNS = (16, 48, 192)  # until a motion has repeated; after each, Newton's method is tried
MAX_MULTIPLE = 8  # slips, or periods of the force, of the longest period
CHUNKS = 12  # communication steps in a turn
GRAZING = 1e-7  # relative distance from the largest amplitude of orbits that do not stick
MAX_DOUBLINGS = 60  # of a change of speed
SPEED_DIFFERENCE = 1e-6  # relative difference of the speed of a body that sticks at once
JUMP = 1e-5  # growth of an amplitude at its zero that is a jump
ROOT_RTOL = 1e-13  # relative accuracy of zeros
SCAN_POINTS = 16  # amplitudes between which orbits that do not stick are sought
REST, TURNING, CYCLE, IRREGULAR = "rest", "sliding", "cycle", "irregular"


class Ending(NamedTuple):
    """What a motion ends in, as seen after a long time.

    Its kind is REST, TURNING (without sticking), CYCLE or IRREGULAR. Of a cycle and of turning, states (n,) where it
    slides and its period in s are a guess of an orbit; `closest` is the smallest relative difference of returns.
    """

    kind: str
    y: np.ndarray
    period: float = nan
    n_sticks: int = 0
    closest: float = inf


class NoOrbitError(HarnessError):
    """Newton's method found no periodic motion."""


class ReturnMap:
    """Periodic motions of an oscillator at its present parameters.

    Parameters
    ----------
    oscillator : Oscillator
        Oscillator, whose parameters may change between calls.

    Attributes
    ----------
    reversal : float
        Last change of the speed of steady sliding by which the slip reverses.
    """

    def __init__(self, oscillator: Oscillator) -> None:
        self.oscillator, self.reversal = oscillator, 1e-3

    # ---- what a motion ends in

    def run_long(self, y: np.ndarray) -> Ending:
        """Return what the motion from states y ends in; what settles slowly is found by Newton's method."""
        end = Ending(IRREGULAR, y)
        for count in RETURNS:
            end = self.follow_returns(end.y, count)
            if end.kind != IRREGULAR:
                break
            with suppress(NoOrbitError):
                orbit = self.shoot(end.y, end.period)
                if orbit.multiplier < 1.0 - NEUTRAL**0.5:
                    return Ending(CYCLE, orbit.y, orbit.period, orbit.n_sticks)
        return end

    def follow_returns(self, y: np.ndarray, count: int) -> Ending:
        """Follow the motion from states y until its returns repeat, or it turns without sticking.

        It returns to the section; under a force, after each period.
        """
        oscillator, period = self.oscillator, self.oscillator.forced_period
        path, returns, maxima = list[Point](), list[Point](), list[tuple[Point, Point]]()
        scale, closest = 1e-300, inf
        for new in oscillator.follow(y, spacing=period or inf):
            last = path[-1] if path else new
            path.append(new)
            scale = max(scale, float(np.abs(oscillator.reduce(new.y)).max()))
            if self.is_maximum(last, new):
                maxima.append((last, new))
            if last.sticks and not new.sticks:
                maxima.clear()
            if new.t == len(returns) * period if period else oscillator.is_return(last, new):
                for old in returns[: -MAX_MULTIPLE - 1 : -1]:
                    difference = self.distance(old.y, new.y) / scale if old.modes == new.modes else inf
                    closest = min(closest, difference)
                    if difference <= REPEATS:
                        cycle = [item for item in path if item.t >= old.t]
                        size = max(float(np.abs(oscillator.reduce(item.y)).max()) for item in cycle)
                        if difference * scale <= REPEATS * size:  # the motion was larger before
                            return self.describe_cycle(cycle)
                returns.append(new)
                if len(returns) > count:
                    end = self.describe_cycle([item for item in path if item.t >= returns[-2].t])
                    return end._replace(kind=IRREGULAR, closest=closest)
            if not period and new.modes and not any(new.modes) and not oscillator.reduce(new.f).any():
                break
            if not period and len(maxima) > MAX_TURNS:
                before, maximum = (self.locate_turn(*pair) for pair in maxima[-2:])
                return Ending(TURNING, maximum.y, maximum.t - before.t)
        return Ending(REST, path[-1].y)

    def describe_cycle(self, path: list[Point]) -> Ending:
        """Return the cycle that a motion has gone through, with the middle of its longest slip.

        If the phase of a force is always the same at the start, it is the start of its period instead.
        """
        slips, n_sticks = list[list[Point]](), 0
        for last, point in zip([path[0], *path], path, strict=False):
            if not point.sticks:
                if last.modes != point.modes or not slips:
                    slips.append([])
                slips[-1].append(point)
            n_sticks += point.sticks and not last.sticks
        if not slips:
            return Ending(REST, path[-1].y)
        longest = max(slips, key=lambda slip: slip[-1].t - slip[0].t)
        middle = min(longest, key=lambda point: abs(2.0 * point.t - longest[0].t - longest[-1].t))
        point = path[0] if self.oscillator.is_forced and not self.oscillator.sets_phase else middle
        return Ending(CYCLE, point.y, path[-1].t - path[0].t, n_sticks)

    def distance(self, y: np.ndarray, other: np.ndarray) -> float:
        """Return the largest difference of the coordinates of two states."""
        return float(np.abs(self.oscillator.reduce(other - y)).max())

    def is_maximum(self, last: Point, point: Point) -> bool:
        """Return whether the state that measures the motion has a maximum between two points."""
        return self.oscillator.measure(last.f) > 0.0 >= self.oscillator.measure(point.f)

    def approaches(self, steady: SteadySliding | None, y: np.ndarray, end: Ending) -> bool:
        """Return whether the motion from states y to an end has nearly settled to steady sliding."""
        return steady is not None and self.distance(end.y, steady.y) <= SETTLED_DISTANCE * self.distance(y, steady.y)

    # ---- orbits

    def find_orbit(self, end: Ending) -> Motion:
        """Return the orbit in which a motion ends; where it has no derivatives, as a cycle that repeats.

        Raises
        ------
        NoOrbitError
            If none is found.
        """
        try:
            return self.shoot(end.y, end.period)
        except NoOrbitError:
            if end.kind != CYCLE:
                raise
            return self.measure_orbit(end.y, end.period, np.full(1, nan))

    def shoot(self, y: np.ndarray, period: float) -> Motion:
        """Return the orbit near states y and a period in s, by Newton's method.

        Raises
        ------
        NoOrbitError
            If it does not converge.
        """
        oscillator, guess = self.oscillator, period
        basis, rate = oscillator.basis, oscillator.rate
        speed = float(np.abs(oscillator.reduce(oscillator.begin(y).f)).max())
        is_free = not oscillator.is_forced
        for _ in range(MAX_ITERATIONS):
            try:
                end, slopes = oscillator.differentiate(y, period)
            except HarnessError as error:  # states far from all motions
                raise NoOrbitError(f"Newton's method does not converge: {error}") from None
            monodromy = oscillator.reduction @ slopes @ basis
            residual, scale = oscillator.reduce(end - y), float(np.abs(oscillator.reduce(y)).max()) or 1.0
            size = float(np.abs(residual).max())
            matrix = monodromy - np.eye(len(monodromy))
            if is_free:
                flow = oscillator.reduce(oscillator.begin(y).f)
                if np.abs(flow).max() < COLLAPSED_RATE * speed:
                    raise NoOrbitError("Newton's method ends in steady sliding")
                ahead = oscillator.reduce(oscillator.begin(end).f)
                matrix = np.block([[matrix, ahead[:, None] / rate], [flow / rate, np.zeros(1)]])
                residual = np.append(residual, 0.0)
            if not np.isfinite(matrix).all():
                break
            change = np.linalg.lstsq(matrix, -residual, rcond=1e-12)[0]
            correction, delay = basis @ change[: len(monodromy)], float(change[-1]) / rate if is_free else 0.0
            largest = np.abs(change[: len(monodromy)]).max()
            if size <= 1e-3 * REPEATS * scale and largest <= REPEATS * scale and abs(delay) <= REPEATS * period:
                break
            y, period = y + correction, period + delay
            if not (largest <= scale and 0.1 * guess < period < 10.0 * guess):
                raise NoOrbitError("Newton's method does not converge")
        return self.measure_orbit(y, period, self.select_multipliers(monodromy))

    def select_multipliers(self, monodromy: np.ndarray) -> np.ndarray:
        """Return the multipliers, the largest first, without that of the direction of motion."""
        if not np.isfinite(monodromy).all():
            return np.full(len(monodromy) - (not self.oscillator.is_forced), nan)
        values = np.linalg.eigvals(monodromy)
        if not self.oscillator.is_forced:
            values = np.delete(values, np.argmin(np.abs(values - 1.0)))
        return values[np.argsort(-np.abs(values))]

    def measure_orbit(self, y: np.ndarray, period: float, multipliers: np.ndarray) -> Motion:
        """Run one period, and measure it.

        Raises
        ------
        NoOrbitError
            If the motion does not repeat.
        """
        oscillator = self.oscillator
        path = [*oscillator.follow(y, period)]
        extremes = [oscillator.measure(point.y) for point in path]
        scale = max(float(np.abs(oscillator.reduce(point.y)).max()) for point in path) or 1.0
        error = self.distance(y, path[-1].y) / scale
        if not error <= CLOSURE_ERROR:
            raise NoOrbitError(f"Newton's method does not converge: the states change by {error:.1e} in a period")
        stick_time, n_sticks = 0.0, 0
        for last, point in pairwise(path):
            stick_time += (point.t - last.t) * last.sticks
            n_sticks += point.sticks and not last.sticks
            if not last.sticks and oscillator.measure(last.f) * oscillator.measure(point.f) < 0.0:
                extremes.append(oscillator.measure(self.locate_turn(last, point).y))
        growth = float(np.log(max(float(np.abs(multipliers).max()), 1e-300))) / period
        return Motion(
            STICK_SLIP if n_sticks else SLIDING_ORBIT,
            y,
            max(extremes),
            min(extremes),
            period,
            stick_time,
            n_sticks,
            growth,
            multipliers,
            error,
        )

    def locate_turn(self, last: Point, point: Point) -> Point:
        """Return the point between two points, at which the state that measures the motion turns."""
        return self.oscillator.locate(last, point, lambda at: self.oscillator.measure(at.f))

    # ---- one body with one contact, around steady sliding

    def start_sticking(self, steady: SteadySliding) -> np.ndarray | None:
        """Return states beside steady sliding from which the body sticks at once; None if there are none.

        Its speed is that at which the slip reverses; its position is one at which friction can hold it.
        """
        oscillator = self.oscillator
        y, modes = steady.y, oscillator.begin(steady.y).modes

        def reverses(change: float) -> bool:
            return oscillator.begin(y + change * oscillator.speeds).modes != modes

        high, low = self.reversal, self.reversal * (1.0 - 2.0 * SPEED_DIFFERENCE)
        for _ in range(MAX_DOUBLINGS):
            if reverses(high) or reverses(-high):
                break
            low, high = high, 4.0 * high
        else:
            return None
        if not reverses(high):
            low, high = -low, -high
        if reverses(low):
            low = 0.0
        while abs(high - low) > 2.0 * SPEED_DIFFERENCE * abs(high):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if reverses(middle) else (middle, high)
        self.reversal = high
        for _ in range(MAX_ITERATIONS):
            points = [oscillator.begin(y + change * oscillator.speeds) for change in (low, high)]
            slope = float(oscillator.speeds @ oscillator.read_jacobian() @ oscillator.displacement)
            rates = [float(oscillator.speeds @ point.f) for point in points]
            if rates[0] * high > 0.0 > rates[1] * high or any(point.sticks for point in points):
                return next((point.y for point in points if point.sticks), points[1].y)
            if not slope:
                break
            y = y - 0.5 * sum(rates) / slope * oscillator.displacement
        return None

    def turn_after_stick(self, steady: SteadySliding) -> tuple[Point, Point] | None:
        """Start a motion that sticks, and go on to its first maximum; return the points before and after it.

        None if it does not stick, or has no maximum afterwards.
        """
        y = self.start_sticking(steady)
        if y is None:
            return None
        last, release_time = self.oscillator.begin(y), inf
        for point in self.oscillator.follow(y):
            if last.sticks and not point.sticks:
                release_time = point.t
            if point.t > release_time and self.is_maximum(last, point):
                return last, point
            if not point.sticks and point.t > MAX_TURNS * steady.turn_time + (
                0.0 if release_time == inf else release_time
            ):
                return None
            last = point
        return None

    def sticks_again(self, steady: SteadySliding) -> bool:
        """Return whether a motion that has stuck sticks again between its first two maxima.

        The changes of mode are counted, so that short sticks are not missed.
        """
        points = self.turn_after_stick(steady)
        if points is None:
            return False
        last = points[1]
        for _ in range(MAX_TURNS * CHUNKS):
            point = self.oscillator.step(last.t, last.t + steady.turn_time / CHUNKS)
            if point.n_changes > last.n_changes:
                return point.sticks or self.sticks_in_turn(last.y, steady.turn_time)
            if self.is_maximum(last, point):
                break
            last = point
        return False

    def sticks_in_turn(self, y: np.ndarray, duration: float) -> bool:
        """Return whether a motion from states y sticks before its next maximum, by each internal step of the FMU.

        It may also pass to sliding in the other direction.
        """
        last = self.oscillator.begin(y)
        for point in self.oscillator.follow(y, MAX_TURNS * duration):
            if point.sticks or self.is_maximum(last, point):
                return point.sticks
            last = point
        return False

    def turn(self, steady: SteadySliding, amplitude: float) -> tuple[float, float]:
        """Return the amplitude after a turn around steady sliding, and its time in s; NaN if the mode changes."""
        last = self.oscillator.begin(steady.y + amplitude * self.oscillator.displacement)
        for _ in range(4 * CHUNKS):
            point = self.oscillator.step(last.t, last.t + steady.turn_time / CHUNKS)
            if point.n_changes:
                break
            if last.t and self.is_maximum(last, point):
                turning_point = self.locate_turn(last, point)
                return self.oscillator.measure(turning_point.y - steady.y), turning_point.t
            last = point
        return nan, nan

    def sliding_orbits(self, steady: SteadySliding) -> tuple[list[Motion], list[str]]:
        """Return the orbits around steady sliding that do not stick, and remarks on those that are not returned.

        A turn that sticks ends with the amplitude of all motions that have stuck. Between neighbouring amplitudes,
        the growth in a turn changes its sign, or turns back before it does.
        """
        points, orbits, remarks = self.turn_after_stick(steady), list[Motion](), list[str]()
        if points is None or not steady.frequency:
            return [], []
        largest = self.oscillator.measure(self.locate_turn(*points).y - steady.y)

        def gain(amplitude: float) -> float:
            """Return the relative growth of an amplitude in a turn."""
            if amplitude == 0.0:
                return float(np.expm1(steady.growth * steady.turn_time))
            after = self.turn(steady, amplitude)[0]
            return (largest if after != after else after) / amplitude - 1.0

        amplitudes = [0.0, *(largest * np.append(np.geomspace(1e-2, 1.0, SCAN_POINTS)[:-1], 1.0 - GRAZING)).tolist()]
        gains = {amplitude: gain(amplitude) for amplitude in amplitudes}
        for a, b, c in zip(amplitudes, amplitudes[1:], amplitudes[2:], strict=False):
            sign = float(np.sign(gains[b]))
            if 0.0 < sign * gains[b] < min(sign * gains[a], sign * gains[c]):
                options = {"xatol": 1e-6 * largest}
                minimum = minimize_scalar(lambda x, sign=sign: sign * gain(x), (a, c), bounds=(a, c), options=options)
                gains[float(minimum.x)] = gain(float(minimum.x))
        neutral = [amplitude for amplitude, growth in gains.items() if amplitude and abs(growth) <= NEUTRAL]
        if len(neutral) > 1:
            largest_neutral = f"orbits of all amplitudes up to at least {max(neutral):.4g}"
            remarks.append(f"{largest_neutral} do not stick, and neither grow nor shrink: none of them is drawn.")
        for a, b in pairwise(sorted(gains)):
            if gains[a] * gains[b] < 0.0 and min(abs(gains[a]), abs(gains[b])) > NEUTRAL:
                amplitude = find_root(gain, a, b, xtol=1e-10 * largest)
                if abs(gain(amplitude)) > JUMP:
                    continue  # from turns that do not stick to turns that do
                try:
                    time = self.turn(steady, amplitude)[1]
                    orbits.append(self.shoot(steady.y + amplitude * self.oscillator.displacement, time))
                except NoOrbitError as error:
                    remarks.append(f"an orbit of the amplitude {amplitude:.4g} does not stick, but {error}.")
        return orbits, remarks


def find_root(function: Callable[[float], float], a: float, b: float, **options: float) -> float:
    """Return a value between a and b at which a function is zero.

    Raises
    ------
    NoOrbitError
        If its values at a and b have the same sign, or one is NaN.
    """
    try:
        return float(brentq(function, a, b, rtol=ROOT_RTOL, **options))
    except ValueError:
        raise NoOrbitError(f"no change of sign was found between {a:.6g} and {b:.6g}") from None
