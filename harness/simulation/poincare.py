"""Return maps of an oscillator, and its periodic orbits.

An orbit of period T from states y solves B^T (Y(T; y) - y) = 0 with the coordinates B of oscillator.py, by Newton's
method with the derivatives of Y through all events. The eigenvalues of B^T Y_y B are its Floquet multipliers; that of
the direction of motion, which is 1 without a force, is left out. An orbit that sticks has a multiplier zero: a cycle
from one end of sticking to the next is exact.

References
----------
R. I. Leine, D. H. van Campen, B. L. van de Vrande, Bifurcations in nonlinear discontinuous systems, Nonlinear Dynamics
23 (2000) 105-164.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import inf, nan, pi

import numpy as np
from scipy.optimize import brentq

from ..errors import HarnessError
from .oscillator import MAX_ITERATIONS, Oscillator, Point

NEUTRAL = 1e-9  # growth of an amplitude in a turn that is none
REPEATS = 1e-9  # relative difference of states that repeat
CLOSED = 1e-8  # the same of the ends of an orbit
MAX_RELEASES, MAX_TURNS, MAX_PERIODS = 64, 64, 256  # until a motion has repeated
NEWTON_PERIODS = (16, 64, MAX_PERIODS)  # of a force, after which Newton's method is tried
MAX_MULTIPLE = 8  # slips, or periods of the force, of the longest period
CHUNKS = 12  # communication steps in a turn
GRAZING = 1e-7  # relative accuracy of the largest amplitude without sticking
SCANNED = 16  # amplitudes between which orbits that do not stick are sought
REST, SLIDING, CYCLE, IRREGULAR = "rest", "sliding", "cycle", "irregular"


@dataclass(frozen=True)
class Orbit:
    """A periodic motion.

    Attributes
    ----------
    y : numpy.ndarray
        States (n,) of a point where it slides.
    period : float
        Period in s.
    largest, smallest : float
        Extreme values of the state that measures the motion.
    stick_time : float
        Time of a period in s in which a contact sticks.
    n_sticks : int
        Number of sticks in a period.
    multipliers : numpy.ndarray
        Floquet multipliers; NaN where no derivative exists.
    error : float
        Largest change of the coordinates after a period, relative to their size.
    """

    y: np.ndarray
    period: float
    largest: float
    smallest: float
    stick_time: float
    n_sticks: int
    multipliers: np.ndarray
    error: float


@dataclass(frozen=True)
class LongMotion:
    """What a motion ends in.

    Attributes
    ----------
    kind : str
        REST, SLIDING (without sticking), CYCLE or IRREGULAR.
    y, period : numpy.ndarray, float
        Guess of the orbit: states (n,) where it slides, and period in s.
    n_sticks : int
        Number of sticks in this period.
    closest : float
        Smallest relative difference of states after up to MAX_MULTIPLE slips or periods of the force.
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
    size : float
        Amplitude from which a motion sticks, as far as known.
    """

    def __init__(self, oscillator: Oscillator) -> None:
        self.oscillator, self.size = oscillator, 1.0

    # ---- what a motion ends in

    def run_long(self, y: np.ndarray) -> LongMotion:
        """Return what the motion from states y ends in."""
        return self.run_free(y) if self.oscillator.phase is None else self.run_forced(y)

    def run_free(self, y: np.ndarray) -> LongMotion:
        """Follow a motion until the states at the ends of two sticks are the same."""
        path, releases, turns, closest = list[Point](), list[Point](), 0, inf
        for point in self.oscillator.follow(y):
            last = path[-1] if path else point
            path.append(point)
            turns += self.is_maximum(last, point)
            if last.sticks and not point.sticks:
                new, turns = point._replace(t=self.oscillator.t_event), 0
                scale = max(float(np.abs(self.oscillator.reduce(item.y)).max()) for item in path)
                for old in releases[: -MAX_MULTIPLE - 1 : -1]:
                    if old.modes == new.modes:
                        closest = min(closest, self.distance(old.y, new.y) / scale)
                        if closest <= REPEATS:
                            return self.describe_cycle([item for item in path if item.t >= old.t], new.t - old.t)
                releases.append(new)
            if point.modes and not any(point.modes) and not self.oscillator.reduce(point.f).any():
                return LongMotion(REST, point.y)
            if turns > MAX_TURNS:
                return LongMotion(SLIDING, point.y)
            if len(releases) > MAX_RELEASES:
                break
        return LongMotion(IRREGULAR, path[-1].y, closest=closest)

    def run_forced(self, y: np.ndarray) -> LongMotion:
        """Follow a motion until the states after periods of the force are the same."""
        period, starts, closest = self.oscillator.forced_period, [y], inf
        assert period is not None
        for number in range(1, MAX_PERIODS + 1):
            path = [*self.oscillator.follow(starts[-1], period)]
            new = path[-1].y
            new[self.oscillator.phase] = y[self.oscillator.phase]
            scale = max(float(np.abs(self.oscillator.reduce(item.y)).max()) for item in path) or 1.0
            for k, old in enumerate(starts[: -MAX_MULTIPLE - 1 : -1], 1):
                closest = min(closest, self.distance(old, new) / scale)
                if closest <= REPEATS:
                    return self.describe_cycle([*self.oscillator.follow(new, k * period)], k * period)
            starts.append(new)
            if number in NEWTON_PERIODS:
                motion = self.describe_cycle([*self.oscillator.follow(new, period)], period)
                try:
                    orbit = self.shoot(motion.y, period)
                except NoOrbitError:
                    continue
                if np.abs(orbit.multipliers).max() < 1.0 - NEUTRAL**0.5:
                    return motion
        return LongMotion(IRREGULAR, starts[-1], closest=closest)

    def describe_cycle(self, path: list[Point], period: float) -> LongMotion:
        """Return the cycle that a motion has gone through, with the middle of its longest slip."""
        slips, n_sticks = list[list[Point]](), 0
        for last, point in zip([path[0], *path], path, strict=False):
            if not point.sticks:
                if last.modes != point.modes or not slips:
                    slips.append([])
                slips[-1].append(point)
            n_sticks += point.sticks and not last.sticks
        if not slips:
            return LongMotion(REST, path[-1].y)
        longest = max(slips, key=lambda slip: slip[-1].t - slip[0].t)
        middle = min(longest, key=lambda point: abs(2.0 * point.t - longest[0].t - longest[-1].t))
        return LongMotion(CYCLE, middle.y, period, n_sticks)

    def distance(self, one: np.ndarray, two: np.ndarray) -> float:
        """Return the largest difference of the coordinates of two states."""
        return float(np.abs(self.oscillator.reduce(two - one)).max())

    def is_maximum(self, last: Point, point: Point) -> bool:
        """Return whether the state that measures the motion has a maximum between two points."""
        return self.oscillator.measure(last.f) > 0.0 >= self.oscillator.measure(point.f)

    # ---- orbits

    def shoot(self, y: np.ndarray, period: float) -> Orbit:
        """Return the orbit near states y and a period in s, by Newton's method.

        Raises
        ------
        NoOrbitError
            If it does not converge.
        """
        oscillator, basis, guess = self.oscillator, self.oscillator.basis, period
        is_free = oscillator.phase is None
        for _ in range(MAX_ITERATIONS):
            end, slopes = oscillator.differentiate(y, period)
            monodromy = basis.T @ slopes @ basis
            residual, scale = oscillator.reduce(end - y), float(np.abs(oscillator.reduce(y)).max()) or 1.0
            size = float(np.abs(residual).max())
            matrix = monodromy - np.eye(len(monodromy))
            if is_free:
                flow = oscillator.reduce(oscillator.begin(y).f)
                ahead = oscillator.reduce(oscillator.begin(end).f)
                matrix = np.block([[matrix, ahead[:, None]], [flow, np.zeros(1)]])
                residual = np.append(residual, 0.0)
            if not np.isfinite(matrix).all():
                break
            change = np.linalg.lstsq(matrix, -residual, rcond=1e-12)[0]
            if size <= 1e-3 * REPEATS * scale and np.abs(change).max() <= REPEATS * scale:
                break
            y = y + basis @ change[: len(monodromy)]
            period += float(change[-1]) if is_free else 0.0
            if not (np.isfinite(y).all() and 0.1 * guess < period < 10.0 * guess):
                raise NoOrbitError("Newton's method does not converge")
        return self.measure_orbit(y, period, self.select_multipliers(monodromy))

    def select_multipliers(self, monodromy: np.ndarray) -> np.ndarray:
        """Return the multipliers, the largest first, without that of the direction of motion."""
        if not np.isfinite(monodromy).all():
            return np.full(len(monodromy) - (self.oscillator.phase is None), nan)
        values = np.linalg.eigvals(monodromy)
        if self.oscillator.phase is None:
            values = np.delete(values, np.argmin(np.abs(values - 1.0)))
        return values[np.argsort(-np.abs(values))]

    def measure_orbit(self, y: np.ndarray, period: float, multipliers: np.ndarray) -> Orbit:
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
        if not error <= CLOSED:
            raise NoOrbitError(f"Newton's method does not converge: the states change by {error:.1e} in a period")
        stick_time, n_sticks = 0.0, 0
        for last, point in pairwise(path):
            stick_time += (point.t - last.t) * last.sticks
            n_sticks += point.sticks and not last.sticks
            if not last.sticks and oscillator.measure(last.f) * oscillator.measure(point.f) < 0.0:
                extremes.append(oscillator.measure(self.locate_turn(last, point).y))
        return Orbit(y, period, max(extremes), min(extremes), stick_time, n_sticks, multipliers, error)

    def locate_turn(self, last: Point, point: Point) -> Point:
        """Return the point between two points, at which the state that measures the motion turns."""
        found = [point]

        def speed(h: float) -> float:
            self.oscillator.begin(last.y)
            found[0] = self.oscillator.step(0.0, h)
            return self.oscillator.measure(found[0].f)

        h = point.t - last.t
        low, high = self.oscillator.measure(last.f), self.oscillator.measure(point.f)
        if high and low * high < 0.0:
            root = brentq(lambda s: low if s == 0.0 else high if s == h else speed(s), 0.0, h, xtol=1e-15, rtol=1e-15)
            speed(max(float(root), 1e-12 * h))
        return found[0]._replace(t=last.t + found[0].t)

    # ---- one oscillator that slides around steady sliding

    def pass_maximum(self, y: np.ndarray, amplitude: float, duration: float) -> tuple[Point, Point] | None:
        """Return points before and after the maximum of one turn about steady sliding y, of about a duration in s.

        None if the motion changes its mode or does not turn.
        """
        last = self.oscillator.begin(y + amplitude * self.oscillator.gauge)
        for _ in range(4 * CHUNKS):
            point = self.oscillator.step(last.t, duration / CHUNKS)
            if point.n_changes:
                break
            if last.t and self.is_maximum(last, point):
                return last, point
            last = point
        return None

    def turn(self, y: np.ndarray, amplitude: float, duration: float) -> tuple[float, float]:
        """Return the amplitude after one turn, and its time in s; NaN if the motion changes its mode."""
        points = self.pass_maximum(y, amplitude, duration)
        if points is None:
            return nan, nan
        found = self.locate_turn(*points)
        return self.oscillator.measure(found.y - y), found.t

    def sliding_amplitude(self, y: np.ndarray, duration: float) -> float:
        """Return the largest amplitude about steady sliding y of a turn without a change of mode, to GRAZING."""
        low, high = 0.0, self.size
        for _ in range(64):
            if self.pass_maximum(y, high, duration) is None:
                break
            low, high = high, 2.0 * high
        while high - low > GRAZING * high and high > 1e-12 * self.size:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.pass_maximum(y, middle, duration) is None else (middle, high)
        self.size = 2.0 * high
        return low

    def sliding_orbits(self, y: np.ndarray, eigenvalues: np.ndarray) -> list[Orbit]:
        """Return the orbits around steady sliding y that do not stick, of an oscillator with two coordinates."""
        growth, duration, orbits = float(eigenvalues[0].real), turn_time(eigenvalues), list[Orbit]()
        if len(eigenvalues) != 2 or not eigenvalues.imag.any():
            return []
        largest = self.sliding_amplitude(y, duration)

        def gain(amplitude: float) -> float:
            """Return the relative growth of an amplitude in a turn."""
            if amplitude == 0.0:
                return float(np.expm1(growth * duration))
            return self.turn(y, amplitude, duration)[0] / amplitude - 1.0

        amplitudes = [0.0, *(largest * np.geomspace(1e-2, 1.0, SCANNED)).tolist()] if largest else []
        gains = [gain(amplitude) for amplitude in amplitudes]
        for a, b, one, two in zip(amplitudes, amplitudes[1:], gains, gains[1:], strict=False):
            if one * two < 0.0 and min(abs(one), abs(two)) > NEUTRAL:
                amplitude = float(brentq(gain, a, b, xtol=1e-10 * largest, rtol=1e-9))
                time = self.turn(y, amplitude, duration)[1]
                orbits.append(self.shoot(y + amplitude * self.oscillator.gauge, time))
        return orbits

    def sticks_in_turn(self, y: np.ndarray, duration: float) -> bool:
        """Return whether a motion from states y sticks before its second maximum, by each internal step of the FMU.

        It may also pass to sliding in the other direction.
        """
        last, maxima = None, 0
        for point in self.oscillator.follow(y, MAX_TURNS * duration):
            maxima += last is not None and self.is_maximum(last, point)
            if point.sticks or maxima > 1:
                return point.sticks
            last = point
        return False

    def sticks_again(self, y: np.ndarray, duration: float) -> bool:
        """Return whether a motion around steady sliding y that has stuck sticks again, before its second maximum.

        A turn takes about a duration in s. The changes of mode are counted, so that short sticks are not missed.
        """
        for _ in range(64):
            last = first = self.oscillator.begin(y + self.size * self.oscillator.gauge)
            n_changes, maxima = 0, 0  # when it slides again after its first stick, and since then
            for _ in range(1000 * CHUNKS):
                point = self.oscillator.step(last.t, duration / CHUNKS)
                maxima += self.is_maximum(last, point)
                if not n_changes and any(a * b < 0 for a, b in zip(point.modes, first.modes, strict=True)):
                    break  # it slides in the other direction: it began with too large an amplitude
                if not n_changes and point.n_changes and point.modes == first.modes:
                    n_changes, maxima = point.n_changes, int(self.is_maximum(last, point))
                if n_changes and point.n_changes > n_changes:
                    return point.sticks or self.sticks_in_turn(last.y, duration)
                if n_changes and maxima > 1:
                    return False
                if not n_changes and maxima > 2:
                    break
                last = point
            self.size *= 0.75 if point.n_changes else 2.0
        return False


def turn_time(eigenvalues: np.ndarray) -> float:
    """Return the time in s of a turn around steady sliding with these eigenvalues in 1/s."""
    return 2.0 * pi / (float(np.abs(eigenvalues.imag).max()) or float(np.abs(eigenvalues).max()))
