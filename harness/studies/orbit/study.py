"""Periodic motions at values of a parameter, and the points at which they begin, end or change their stability."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf, nan

import numpy as np
from scipy.optimize import minimize_scalar

from ...scenes.run_spec import RunSpec
from ...simulation.edges import find_edges
from ...simulation.motion import AT_REST, SLIDING_ORBIT, STEADY, STICK_SLIP, Motion
from ...simulation.native_equivalent import native_with_derivatives
from ...simulation.oscillator import Oscillator, SteadySliding, open_oscillator
from ...simulation.poincare import (
    IRREGULAR,
    REST,
    RETURNS,
    NoOrbitError,
    ReturnMap,
    find_root,
)
from .result import OrbitResult, SpecialPoint

PATH_POINTS = 400  # at least, of an orbit in the phase plane
ENDS, BEGINS = "ends", "begins"
NEAR = 1e-6  # relative difference of orbits that are the same
MAX_RESTARTS = 16  # of the bisection on whether a motion is found


class BranchTracer:
    """Finds the motions of an oscillator at values of its varied parameter.

    Attributes
    ----------
    remarks : list of str
        What is neither at rest nor periodic.
    """

    def __init__(self, oscillator: Oscillator) -> None:
        self.oscillator, self.map, self.remarks = oscillator, ReturnMap(oscillator), list[str]()

    # ---- motions at one value

    def find_motions(self, value: float, seeds: Sequence[np.ndarray]) -> list[Motion]:
        """Return the motions at a value of the parameter: steady sliding, and what motions from the seeds end in."""
        self.set_value(value)
        motions, orbits, remarks = list[Motion](), list[Motion](), list[str]()
        steady = self.oscillator.find_steady_sliding()
        if steady is not None:
            motions.append(self.describe_steady_sliding(steady))
        if steady is not None and self.oscillator.is_one_body:
            orbits, remarks = self.map.sliding_orbits(steady)
            turn = self.map.turn_after_stick(steady) if self.map.sticks_again(steady) else None
            if turn is not None or steady.growth < 0.0:  # a motion that sticks forgets its start
                seeds = [] if turn is None else [turn[1].y]
        for seed in seeds:
            end = self.map.run_long(seed)
            if end.kind == REST:
                x = self.oscillator.measure(end.y)
                motions.append(Motion(AT_REST, end.y, x, x))
            elif end.kind == IRREGULAR:
                remarks.append(describe_irregular(end.closest))
            elif not self.map.approaches(steady, seed, end):
                try:
                    orbits.append(self.map.find_orbit(end))
                except NoOrbitError as error:
                    remarks.append(f"from the start, {error}.")
        for orbit in orbits:
            if not any(is_same(orbit, other) for other in motions):
                motions.append(orbit)
        self.remarks += [f"{self.name_value(value)}: {remark}" for remark in remarks]
        return [replace(motion, value=value) for motion in sorted(motions, key=lambda motion: motion.amplitude)]

    def set_value(self, value: float) -> None:
        """Set the varied parameter, if there is one."""
        if self.oscillator.varied_names:
            self.oscillator.set_point([value])

    def name_value(self, value: float) -> str:
        """Return the value with the name of the parameter."""
        return (
            f"{self.oscillator.varied_names[0]} = {value:.6g}"
            if self.oscillator.varied_names
            else self.oscillator.spec.model
        )

    def describe_steady_sliding(self, steady: SteadySliding) -> Motion:
        """Return steady sliding; its period is that of small oscillations around it."""
        x, period = self.oscillator.measure(steady.y), steady.turn_time if steady.frequency else nan
        multipliers = np.exp(steady.eigenvalues * period)
        return Motion(STEADY, steady.y, x, x, period, growth=steady.growth, multipliers=multipliers)

    def trace_path(self, motion: Motion) -> np.ndarray:
        """Return a period of a motion (points, 4): time in s, the state that measures it, its rate, and 1 at returns.

        Motions return to the section; one that does not pass it, to the maximum of the state.
        """
        is_orbit, step = motion.kind in (STICK_SLIP, SLIDING_ORBIT), motion.period / PATH_POINTS
        path = [*self.oscillator.follow(motion.y, motion.period if is_orbit else 0.0, step if is_orbit else inf)]
        passes = [False, *(self.oscillator.is_return(*pair) for pair in pairwise(path))]
        x = np.array([self.oscillator.measure(point.y) for point in path])
        passes = passes if any(passes) else x == x.max()
        return np.column_stack([[p.t for p in path], x, [self.oscillator.measure(p.f) for p in path], passes])

    # ---- special points between two values

    def locate(self, lower: list[Motion], upper: list[Motion]) -> list[SpecialPoint]:
        """Return the special points between the motions at two neighbouring values."""
        low, high = lower[0].value, upper[0].value
        steady = [next((motion for motion in motions if motion.kind == STEADY), None) for motions in (lower, upper)]
        sticks = [any(motion.kind == STICK_SLIP for motion in motions) for motions in (lower, upper)]
        sliding_orbits = [[motion for motion in motions if motion.kind == SLIDING_ORBIT] for motions in (lower, upper)]
        points = []
        if steady[0] and steady[1]:
            if (steady[0].growth < 0.0) != (steady[1].growth < 0.0):
                points.append(self.locate_stability(low, high))
            if sticks[0] != sticks[1] and self.oscillator.is_one_body:
                points.append(self.locate_grazing(low, high, sticks[0]))
            if not points and self.oscillator.is_one_body and abs(len(sliding_orbits[0]) - len(sliding_orbits[1])) == 2:
                points.append(self.locate_fold(low, high, *sliding_orbits))
        return points

    def steady_sliding(self, value: float) -> SteadySliding:
        """Return steady sliding at a value.

        Raises
        ------
        NoOrbitError
            If there is none.
        """
        self.set_value(value)
        steady = self.oscillator.find_steady_sliding()
        if steady is None:
            raise NoOrbitError(f"there is no steady sliding at {self.name_value(value)}")
        return steady

    def locate_stability(self, low: float, high: float) -> SpecialPoint:
        """Return the value at which an eigenvalue of steady sliding has no real part."""
        value = find_root(lambda value: self.steady_sliding(value).growth, low, high)
        change = "stable" if self.steady_sliding(low).growth > self.steady_sliding(high).growth else "unstable"
        x = self.oscillator.measure(self.steady_sliding(value).y)
        return SpecialPoint(value, f"steady sliding turns {change}", x, "zero of the real part of its eigenvalue")

    def locate_grazing(self, low: float, high: float, sticks_below: bool) -> SpecialPoint:
        """Return the value at which stick-slip begins or ends, by whether a motion that has stuck sticks again."""
        ((last, first, *_),) = find_edges(
            lambda value: self.map.sticks_again(self.steady_sliding(value)), low, high, sticks_below, not sticks_below
        )
        edge = last if sticks_below else first
        turn = self.map.turn_after_stick(self.steady_sliding(edge))
        x = nan if turn is None else self.oscillator.measure(self.map.locate_turn(*turn).y)
        kind = "stick-slip ends" if sticks_below else "stick-slip begins"
        return SpecialPoint(edge, kind, x, "bisection on whether it sticks again")

    def locate_fold(self, low: float, high: float, below: list[Motion], above: list[Motion]) -> SpecialPoint:
        """Return the value at which two orbits that do not stick meet: the extreme one along their branch."""
        is_below = len(below) > len(above)
        pair = (below if is_below else above)[-2:]

        def value_of(amplitude: float) -> float:
            """Return the value at which a turn ends with the amplitude with which it starts."""
            return find_root(
                lambda value: self.map.turn(self.steady_sliding(value), amplitude)[0] / amplitude - 1.0, low, high
            )

        x = self.oscillator.measure(self.steady_sliding(pair[0].value).y)
        sign, ends = (-1.0 if is_below else 1.0), [motion.largest - x for motion in pair]
        best = minimize_scalar(lambda a: sign * value_of(a), bounds=ends, method="bounded", options={"xatol": 1e-8})
        value = value_of(best.x)
        return SpecialPoint(value, "fold: two orbits meet", x + best.x, "extreme value along the branch")

    def follow(self, motions: list[Motion], targets: list[Motion], value: float, change: str) -> list[SpecialPoint]:
        """Follow motions to another value, where they are added to those with other names, or up to a special point.

        Around steady sliding of one body all motions are known.
        """
        points, names = list[SpecialPoint](), {motion.name for motion in targets}
        for motion in (
            motions if not (self.oscillator.is_one_body and any(item.kind == STEADY for item in targets)) else ()
        ):
            if motion.kind != STEADY and motion.name not in names:
                tracked_motion, n_remarks = TrackedMotion(self, motion), len(self.remarks)
                end, is_found = motion.value, True
                for _ in range(MAX_RESTARTS):  # found from nearby, where it was not found from far away
                    if end == value or not is_found:
                        break
                    ((edge, end, *_),) = find_edges(tracked_motion.move_to, end, value, True, False)
                    is_found = tracked_motion.move_to(end)
                if end == value and is_found:
                    targets.append(tracked_motion.motion)
                else:
                    how = "bisection on whether it is found"
                    points.append(SpecialPoint(edge, f"{motion.name} {change}", tracked_motion.motion.largest, how))
                del self.remarks[n_remarks:]  # on values between these two
        return points


class TrackedMotion:
    """Follows a motion from one value of the parameter to the next.

    Attributes
    ----------
    motion : Motion
        The motion at the last value at which it was found.
    """

    def __init__(self, tracer: BranchTracer, motion: Motion) -> None:
        self.tracer, self.motion = tracer, motion

    def move_to(self, value: float) -> bool:
        """Return whether the motion is found at a value, starting from where it was found last."""
        motions = self.tracer.find_motions(value, [self.motion.y])
        match = next((motion for motion in motions if motion.name == self.motion.name), None)
        self.motion = match or self.motion
        return match is not None


def join_changes(points: list[SpecialPoint]) -> list[SpecialPoint]:
    """Return the points in order, with the end of one motion where another one begins as one point."""
    joined_points = list[SpecialPoint]()
    for point in sorted(points, key=lambda point: (point.value, point.kind)):
        last = joined_points[-1] if joined_points else point
        kinds = sorted((last.kind, point.kind), key=lambda kind: kind.endswith(BEGINS))
        is_near = abs(point.value - last.value) <= NEAR * abs(point.value)
        if is_near and kinds[0].endswith(ENDS) and kinds[1].endswith(BEGINS):
            joined_points[-1] = replace(
                last, kind=f"{kinds[0].removesuffix(f' {ENDS}')} become {kinds[1].removesuffix(f' {BEGINS}')}"
            )
        else:
            joined_points.append(point)
    return joined_points


def is_same(motion: Motion, other: Motion) -> bool:
    """Return whether two motions are the same."""
    size = max(abs(motion.largest), abs(motion.smallest))
    near = abs(motion.largest - other.largest) <= NEAR * size and abs(motion.smallest - other.smallest) <= NEAR * size
    return (
        motion.kind == other.kind
        and near
        and (motion.kind == AT_REST or abs(motion.period - other.period) <= NEAR * motion.period)
    )


def describe_irregular(closest: float) -> str:
    """Return a sentence on a motion that is neither at rest nor periodic."""
    return (
        f"the motion from the start has not repeated in {sum(RETURNS)} slips or periods of the force; the closest "
        f"states differ by {closest:.1e}: it is quasi-periodic, chaotic, or slow to settle."
    )


def compute_orbits(
    spec: RunSpec,
    parameter: str = "",
    values: Sequence[float] = (),
    period: float | None = None,
    section: str = "",
    report: Callable[[float], None] = lambda share: None,
) -> OrbitResult:
    """Find the periodic motions of an FMU, at one point or over a parameter.

    Parameters
    ----------
    spec : RunSpec
        FMU, values, and start values.
    parameter : str
        Parameter that varies; empty for none.
    values : sequence of float
        Its increasing values.
    period : float or None
        Period in s of forces that depend on a clock.
    section : str
        What free motions return to, as in `Oscillator`.
    report : callable
        Receives the progress from 0 to 1.

    Raises
    ------
    SceneError
        If a name or a value is not valid.
    HarnessError
        If the FMU is not suitable.
    """
    run = replace(spec, fmu=native_with_derivatives(spec.fmu))
    with open_oscillator(run, (parameter,) if parameter else (), period, section) as oscillator:
        tracer, motions, points = BranchTracer(oscillator), list[list[Motion]](), list[SpecialPoint]()
        for number, value in enumerate(values or (nan,)):
            seeds = [motion.y for motion in (motions[-1] if motions else ()) if motion.kind != STEADY]
            motions.append(tracer.find_motions(value, [*seeds, oscillator.start]))
            if number:
                points += tracer.follow(motions[-2], motions[-1], value, ENDS)
            report(0.8 * (number + 1) / max(1, len(values)))
        for number in reversed(range(len(motions) - 1)):
            points += tracer.follow(motions[number + 1], motions[number], values[number], BEGINS)
        for number, (lower, upper) in enumerate(pairwise(motions), 1):
            try:
                points += tracer.locate(lower, upper) if lower and upper else []
            except NoOrbitError as error:
                name = tracer.name_value(values[number])
                tracer.remarks.append(f"a special point below {name} is not located: {error}.")
            report(0.8 + 0.2 * number / len(values))
        points = join_changes(points)
        all_motions = tuple(
            motion for group in motions for motion in sorted(group, key=lambda motion: motion.amplitude)
        )
        coordinate = oscillator.states[oscillator.coordinate]
        options = {"over": {parameter: [*values]} if parameter else None, "section": section, "period": period}
        return OrbitResult(
            spec,
            parameter,
            oscillator.units.get(parameter, ""),
            coordinate,
            oscillator.rates[oscillator.coordinate],
            oscillator.units[coordinate],
            all_motions,
            tuple(points),
            () if parameter else tuple(tracer.trace_path(motion) for motion in all_motions),
            tuple(dict.fromkeys(tracer.remarks)),
            oscillator.n_runs,
            {name: oscillator.default(name) for name in oscillator.parameters},
            {name: value for name, value in options.items() if value},
        )
