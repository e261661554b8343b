"""Second formulations of the models in fmus/more, integrated by scipy from event to event.

This module shares nothing with the FMUs.  A problem has modes, which are constant between events: the mode of each
contact (-1, 0 stuck, 1), and the signs of the conditions where its equations have a kink or a jump.  A sliding contact
has one guard, its slip; a stuck one has two, the distances of its load from both limits; a condition has one, its
value.  An event is the zero of a guard.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import cos, exp, pi, sin, sqrt
from typing import Any

import numpy as np

from harness.errors import HarnessError
from harness.references.certified_reference import POINTS, relative_errors
from harness.simulation.solution import Solution

StateVector = Sequence[float] | np.ndarray
OVERLOAD = 1e-9  # a load that exceeds its limit by a smaller share is at the limit
LARGEST_STEP = 1.0 / 400.0  # share of the run
FINE_SHARE = 1.0 / 30.0  # of the largest step: a run with it finds pulses that both routes pass
TOLERANCES = {"DOP853": (3e-14, 1e-17), "Radau": (1e-11, 1e-15)}  # of the two routes: relative and absolute


class HybridProblem:
    """An initial value problem with contacts and conditions.

    Attributes
    ----------
    start : tuple of float
        Initial values of the states that the solver of the FMU integrates.
    stop : float
        Stop time in s.
    first : tuple of int
        Modes of the contacts at the start; contacts come before conditions.
    """

    start: tuple[float, ...]
    stop: float
    first: tuple[int, ...] = ()

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        """Return the rates of the states."""
        raise NotImplementedError

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        """Return slip, force and largest holding force of each contact."""
        return []

    def conditions(self, t: float, y: StateVector) -> list[float]:
        """Return the values whose signs the equations depend on."""
        return []

    def stop_slip(self, y: np.ndarray, modes: list[int]) -> None:
        """Set the slips of stuck contacts, which have rounding errors, to zero."""

    def guards(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        """Return the guards, which are positive until the next event."""
        values = []
        for mode, (slip, force, hold) in zip(modes, self.contacts(t, y, modes), strict=False):
            values += [mode * slip] if mode else [hold - force, hold + force]
        conditions = self.conditions(t, y)
        signs = modes[len(modes) - len(conditions) :]
        return values + [sign * value for sign, value in zip(signs, conditions, strict=True)]

    def change(self, index: int, modes: list[int]) -> None:
        """Change the mode whose guard, of this index, fell to zero."""
        for i, mode in enumerate(modes):
            is_stuck = i < len(self.first) and mode == 0
            size = 2 if is_stuck else 1
            if index < size:
                modes[i] = (1, -1)[index] if is_stuck else 0 if i < len(self.first) else -mode
                return
            index -= size

    def resolve(self, t: float, y: np.ndarray, modes: list[int]) -> None:
        """Set stuck contacts whose loads exceed their limits to slip, one after the other."""
        self.stop_slip(y, modes)
        while True:
            contacts = self.contacts(t, y, modes)
            overloaded_contacts = [
                i for i, (_, f, hold) in enumerate(contacts) if modes[i] == 0 and abs(f) > hold * (1.0 + OVERLOAD)
            ]
            if not overloaded_contacts:
                return
            modes[overloaded_contacts[0]] = 1 if contacts[overloaded_contacts[0]][1] > 0.0 else -1


Events = list[tuple[float, tuple[int, ...]]]


def solve(
    problem: HybridProblem,
    times: Sequence[float],
    method: str,
    rtol: float,
    atol: float,
    largest_step: float = LARGEST_STEP,
) -> tuple[np.ndarray, Events]:
    """Return the states (times, states) and the changes of the modes of contacts, by a method of scipy.

    `largest_step` is a share of the run.
    """
    from scipy.integrate import solve_ivp

    t, y, n = float(times[0]), np.array(problem.start), len(problem.first)
    modes = [*problem.first, *(1 if value >= 0.0 else -1 for value in problem.conditions(t, y))]
    rows, events = [y.copy()], []
    for end in times[1:]:
        while t < end:
            count = len(problem.guards(t, y, modes))
            functions = [_guard_function(problem, modes, i) for i in range(count)]
            run = solve_ivp(
                lambda t, y: problem.rates(t, y, modes),
                (t, end),
                y,
                method,
                events=functions or None,
                rtol=rtol,
                atol=atol,
                max_step=largest_step * problem.stop,
            )
            t, y = float(run.t[-1]), run.y[:, -1].copy()
            if run.status == 1:
                before = modes[:n]
                for index, event_times in enumerate(run.t_events):
                    if len(event_times):
                        problem.change(index, modes)
                        break
                problem.resolve(t, y, modes)
                if modes[:n] != before:
                    events.append((t, tuple(modes[:n])))
        rows.append(y.copy())
    return np.array(rows), events


def _guard_function(problem: HybridProblem, modes: list[int], index: int) -> Callable[[float, np.ndarray], float]:
    def guard(t: float, y: np.ndarray) -> float:
        return problem.guards(t, y, modes)[index]

    attributes: Any = guard
    attributes.terminal, attributes.direction = True, -1
    return guard


def certify_by_two_routes(name: str) -> Solution:
    """Return the default run of a model in fmus/more by an explicit and an implicit method of scipy.

    Raises
    ------
    HarnessError
        If they find different changes of mode, or the explicit one does with a thirtieth of the largest step.
    """
    return certify_problem(name, PROBLEMS[name]())


def certify_problem(name: str, problem: HybridProblem) -> Solution:
    """Return the solution of a problem by both methods; `name` is that of the model in messages."""
    times = np.linspace(0.0, problem.stop, POINTS)
    explicit, implicit = (partial(solve, problem, times.tolist(), method, *TOLERANCES[method]) for method in TOLERANCES)
    (states, events), *others = explicit(), implicit(), explicit(largest_step=FINE_SHARE * LARGEST_STEP)
    for _, other_events in others:
        if [modes for _, modes in other_events] != [modes for _, modes in events]:
            raise HarnessError(
                f"{name}: {' and '.join(TOLERANCES)}, or DOP853 and its run with a thirtieth of the largest step, find "
                "different changes of mode, so the result is not certified; correct the problem in event_located.py"
            )
    difference = max(float(relative_errors(other, states).max()) for other, _ in others)
    reference = Solution(times, states, [], method=" and ".join(TOLERANCES), estimated_error=difference)
    if len(problem.first) != 1:
        return reference
    return replace(reference, events=[(t, mode) for t, (mode,) in events], start_mode=problem.first[0])


class Belt(HybridProblem):
    """Block on a belt; `friction` is the sliding force over the size of the slip."""

    start, stop, first = (1.067, 0.0), 50.0, (-1,)
    v_belt = 0.2

    def friction(self, slip: float) -> float:
        """Return the sliding force at a slip of this size."""
        return 1.0 / (1.0 + 3.0 * slip)

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        x, v = y
        return [v, -x - modes[0] * self.friction(modes[0] * (v - self.v_belt)) if modes[0] else 0.0]

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        return [(y[1] - self.v_belt, -y[0], 1.0)]

    def stop_slip(self, y: np.ndarray, modes: list[int]) -> None:
        if modes[0] == 0:
            y[1] = self.v_belt


class StribeckBelt(Belt):
    """Block on a belt with the Stribeck curve."""

    def friction(self, slip: float) -> float:
        return 0.7 + 0.3 * exp(-((slip / 0.1) ** 2)) + 0.05 * slip


class CoulombBelt(Belt):
    """Block on a belt with constant sliding friction below the static friction."""

    def friction(self, slip: float) -> float:
        return 0.7


class Bristles(HybridProblem):
    """Mass pulled through a spring, with LuGre friction, which has a kink where the speed changes its sign."""

    start: tuple[float, ...] = (0.0, 0.0, 0.0)
    stop = 20.0
    sigma_0, sigma_1, sigma_2, F_c, F_s, v_s = 1e5, sqrt(1e5), 0.4, 1.0, 1.5, 1e-3

    def pull(self, t: float, x: float) -> float:
        """Return the force on the mass without friction."""
        return 2.0 * (0.1 * t - x)

    def steady_force(self, v: float) -> float:
        """Return the friction force of steady sliding, without the viscous part."""
        return self.F_c + (self.F_s - self.F_c) * exp(-((v / self.v_s) ** 2))

    def conditions(self, t: float, y: StateVector) -> list[float]:
        return [y[1]]

    def plastic_share(self, v: float, z: float, modes: list[int]) -> float:
        """Return the plastic share of the motion."""
        return modes[0] * self.sigma_0 * z / self.steady_force(v)

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        x, v, z = y
        rate = v * (1.0 - self.plastic_share(v, z, modes))
        return [v, self.pull(t, x) - self.sigma_0 * z - self.sigma_1 * rate - self.sigma_2 * v, rate]


class DryBlock(Bristles):
    """The same mass with Coulomb and viscous friction, the law with sticking that bristle models approximate."""

    start, first = (0.0, 0.0), (0,)

    def conditions(self, t: float, y: StateVector) -> list[float]:
        return []

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        x, v = y
        return [v, self.pull(t, x) - modes[0] * self.F_c - self.sigma_2 * v if modes[0] else 0.0]

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        return [(y[1], self.pull(t, y[0]), self.F_s)]

    def stop_slip(self, y: np.ndarray, modes: list[int]) -> None:
        if modes[0] == 0:
            y[1] = 0.0


class ElastoplasticBristles(Bristles):
    """The same mass with elasto-plastic friction; its law is smooth where the deflection passes z_ba and z_ss."""

    z_ba = 7e-6

    def plastic_share(self, v: float, z: float, modes: list[int]) -> float:
        size, z_ss = abs(z), self.steady_force(v) / self.sigma_0
        if modes[0] * z <= 0.0 or size <= self.z_ba:
            return 0.0
        if size >= z_ss:
            return size / z_ss
        return 0.5 * (1.0 + sin(pi * (size - 0.5 * (z_ss + self.z_ba)) / (z_ss - self.z_ba))) * size / z_ss


class Sleds(HybridProblem):
    """Two sleds in a row."""

    start, stop, first = (0.0,) * 4, 16.0, (0, 0)

    def loads(self, t: float, y: StateVector) -> tuple[float, float]:
        """Return the forces on both sleds without friction."""
        link = 1100.0 * (y[0] - y[2])
        return 742.5 * (0.034 * t - y[0]) - link, link

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        first, second = self.loads(t, y)
        a_1 = (first - modes[0] * 73.575) / 12.5 if modes[0] else 0.0
        return [y[1], a_1, y[3], (second - modes[1] * 40.0) / 8.0 if modes[1] else 0.0]

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        first, second = self.loads(t, y)
        return [(y[1], first, 110.3625), (y[3], second, 66.0)]

    def stop_slip(self, y: np.ndarray, modes: list[int]) -> None:
        for i, mode in enumerate(modes):
            if mode == 0:
                y[2 * i + 1] = 0.0


class Stacked(HybridProblem):
    """A block on a block, with four cases; in two of them both blocks move as one body."""

    start, stop, first = (0.0,) * 4, 8.0, (0, 0)
    slide_1, slide_2 = 0.15 * 6.0 * 9.81, 0.5 * 2.0 * 9.81

    def forces(self, t: float, y: StateVector, modes: list[int]) -> tuple[float, float, float, float]:
        """Return both friction forces and both accelerations."""
        pull, back = 400.0 * (0.2 * t - y[2]), -150.0 * y[0]
        if modes[1]:
            upper = modes[1] * self.slide_2
            lower = modes[0] * self.slide_1 if modes[0] else back + upper
            return lower, upper, (back + upper - lower) / 4.0, (pull - upper) / 2.0
        lower = modes[0] * self.slide_1 if modes[0] else back + pull
        a = (pull + back - lower) / 6.0
        return lower, pull - 2.0 * a, a, a

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        _, _, a_1, a_2 = self.forces(t, y, modes)
        return [y[1], a_1, y[3], a_2]

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        lower, upper, *_ = self.forces(t, y, modes)
        return [(y[1], lower, 1.4 * self.slide_1), (y[3] - y[1], upper, 1.4 * self.slide_2)]

    def stop_slip(self, y: np.ndarray, modes: list[int]) -> None:
        if modes[0] == 0:
            y[1] = 0.0
        if modes[1] == 0:
            y[3] = y[1] = 0.0 if modes[0] == 0 else (4.0 * y[1] + 2.0 * y[3]) / 6.0


class Forced(HybridProblem):
    """Spring and mass with dry friction under a harmonic force."""

    start, stop, first = (0.0, 0.0), 10.0, (1,)

    def load(self, t: float, x: float) -> float:
        """Return the force without friction."""
        return 10.0 * cos(5.0 * t) - 100.0 * x

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        return [y[1], self.load(t, y[0]) - 6.0 * modes[0] if modes[0] else 0.0]

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        return [(y[1], self.load(t, y[0]), 6.0)]

    def stop_slip(self, y: np.ndarray, modes: list[int]) -> None:
        if modes[0] == 0:
            y[1] = 0.0


class Clutch(HybridProblem):
    """Two inertias with a clutch, and the phase angle of its normal force, whose sign is the condition."""

    start, stop, first = (10.0, 0.0, 0.0), 1.5, (1,)

    def conditions(self, t: float, y: StateVector) -> list[float]:
        return [20.0 * cos(0.4 * pi * t)]

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        drive = 10.0 * sin(10.0 * pi * t)
        torque = 0.0 if modes[1] < 0 else modes[0] * 10.0 * cos(0.4 * pi * t) if modes[0] else 0.5 * drive
        return [drive - torque, torque, 0.4 * pi]

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        if modes[1] < 0:
            return [(modes[0] * 1e3, 0.0, 1.0)]  # no friction, so no event
        return [(y[0] - y[1], 5.0 * sin(10.0 * pi * t), 11.0 * cos(0.4 * pi * t))]

    def stop_slip(self, y: np.ndarray, modes: list[int]) -> None:
        if modes[0] == 0 and modes[1] > 0:
            y[0] = y[1] = 0.5 * (y[0] + y[1])


class Joint(HybridProblem):
    """Motor, gear and load with friction on both sides, and a PI controller."""

    start, stop, first = (0.0,) * 5, 4.0, (0, 0)

    def loads(self, t: float, y: StateVector) -> tuple[float, float, float]:
        """Return the torques on motor and load without friction, and the speed error."""
        motor, speed, load, load_speed, integral = y
        error = 50.0 * sin(pi * t) - speed
        gear = 2e4 * (0.01 * motor - load) + 20.0 * (0.01 * speed - load_speed)
        return 0.05 * error + 0.5 * integral - 0.01 * gear, gear, error

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        motor, gear, error = self.loads(t, y)
        alpha = 1e3 * (motor - 0.08 * modes[0]) if modes[0] else 0.0
        return [y[1], alpha, y[3], 0.2 * (gear - 10.0 * modes[1]) if modes[1] else 0.0, error]

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        motor, gear, _ = self.loads(t, y)
        return [(y[1], motor, 0.1), (y[3], gear, 15.0)]

    stop_slip = Sleds.stop_slip


class Servo(HybridProblem):
    """Axis under PID control; the conditions are the points of its friction curve, in the sizes of the speed."""

    start, stop, first = (0.0, 0.0, 0.0), 10.0, (1,)
    speeds = (0.0, 0.001, 0.005, 0.02, 0.05, 0.1, 0.2)
    forces = (30.0, 26.0, 18.0, 15.0, 16.0, 18.0, 22.0)

    def conditions(self, t: float, y: StateVector) -> list[float]:
        return [abs(y[1]) - speed for speed in self.speeds[1:-1]]

    def drive(self, y: StateVector) -> float:
        """Return the force of the controller."""
        return 2e4 * (0.01 - y[0]) - 500.0 * y[1] + 5e4 * y[2]

    def friction(self, speed: float, piece: int) -> float:
        """Return the sliding force on the line through the two points of a piece."""
        (v_1, v_2), (f_1, f_2) = self.speeds[piece : piece + 2], self.forces[piece : piece + 2]
        return f_1 + (f_2 - f_1) * (speed - v_1) / (v_2 - v_1)

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        mode, piece = modes[0], sum(sign > 0 for sign in modes[1:])
        a = (self.drive(y) - mode * self.friction(mode * y[1], piece)) / 10.0 if mode else 0.0
        return [y[1], a, 0.01 - y[0]]

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        return [(y[1], self.drive(y), self.forces[0])]

    stop_slip = Forced.stop_slip


PROBLEMS: dict[str, type[HybridProblem]] = {
    "belt": Belt,
    "lugre": Bristles,
    "elastoplastic": ElastoplasticBristles,
    "sleds": Sleds,
    "stacked": Stacked,
    "forced": Forced,
    "clutch": Clutch,
    "joint": Joint,
    "servo": Servo,
}
