"""Compound pendulum with friction in its pin, by scipy's DOP853, restarted at every change of mode or value."""

from collections.abc import Iterator
from dataclasses import replace
from math import copysign, cos, hypot, inf, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np

from ...scenes.run_spec import RunSpec
from ..certified_reference import ReferenceCase
from ..ode_problem import JacobianFunction, OdeProblem, RhsFunction, StateVector
from ..segments import MotionFunction, ParameterSpan, ParameterValues, Segment, constant_velocity, shift_time

POUND, INCH = 0.45359237, 0.0254
REACTION = 2  # value of the enumeration pin_load
PI_REMAINDER = 1.2246467991473532e-16  # pi minus its double


class PendulumProblem(OdeProblem):
    """Compound pendulum with friction in its pin, loaded by the weight."""

    start, stop, unit, has_dry_friction = (radians(10.02), 0.0), 5.0, "rad", True
    m, a, g, r, mu = 0.46 * POUND, 3.7 * INCH, 386 * INCH, 0.25 * INCH, 0.1
    inertia = 1.5 * POUND * INCH**2 + m * a * a

    def rates(self, mode: int) -> RhsFunction:
        square = self.m * self.g * self.a / self.inertia
        drag = mode * self.mu * self.r * self.m * self.g / self.inertia
        return lambda t, y: (y[1], -square * sin(y[0]) - drag)

    def jacobian(self, mode: int) -> JacobianFunction | None:
        square = self.m * self.g * self.a / self.inertia
        return lambda t, y: [[0.0, 1.0], [-square * cos(y[0]), 0.0]]

    def static_load(self, t: float, x: float) -> tuple[float, float, float]:
        return -self.m * self.g * self.a * sin(x), 0.0, self.mu * self.r * self.m * self.g


class PendulumReactionProblem(PendulumProblem):
    """Pendulum whose pin is loaded by the reaction N, which depends on friction itself:

    N^2 = R^2 + (b - mode s N)^2,    R = m g cos(x) + m a v^2,    b = m g sin(x) (1 - m a^2/J),    s = mu r m a/J
    """

    def rates(self, mode: int) -> RhsFunction:
        weight, moment, arm = self.m * self.g, self.m * self.a, self.mu * self.r
        share = 1 - moment * self.a / self.inertia
        s = mode * arm * moment / self.inertia
        rest = 1 - s * s

        def rates(t: float, y: StateVector) -> tuple[float, float]:
            x, v = y
            radial, b = weight * cos(x) + moment * v * v, weight * sin(x) * share
            normal = (sqrt(b * b + rest * radial * radial) - s * b) / rest
            return v, -(weight * self.a * sin(x) + mode * arm * normal) / self.inertia

        return rates

    jacobian = OdeProblem.jacobian


def solve_segments(spans: list[ParameterSpan]) -> Iterator[Segment]:
    """Yield the motion from one standstill to the next, and the rests between.

    The angle counts from the hanging or the inverted position, whichever is nearer, so that it keeps its digits there.
    """
    theta, omega = spans[0][2]["theta0"], spans[0][2]["omega0"]
    half_turns = round(theta / pi)
    angle = (theta - half_turns * pi) - half_turns * PI_REMAINDER
    for begin, end, p in spans:
        pin, t = PinJoint(p, -1 if half_turns % 2 else 1), begin
        while t < end:
            load = pin.load(angle, t - begin)
            mode = int(copysign(1, omega)) if omega else pin.direction(load)
            if mode == 0:
                yield Segment(t, 0, shift_angle(constant_velocity(angle, 0.0), half_turns * pi))
                t, mode = t + pin.time_to_breakaway(load), int(copysign(1, pin.rate))
                if not t < end:
                    break
            duration, angle, omega, at = integrate_to_standstill(pin, mode, t - begin, end - t, angle, omega)
            yield Segment(t, mode, shift_angle(shift_time(at, t), half_turns * pi))
            t += duration


def shift_angle(at: MotionFunction, origin: float) -> MotionFunction:
    """Return a motion whose angle counts from `origin` (rad) instead of 0."""
    return lambda t: (origin + at(t)[0], at(t)[1])


class PinJoint:
    """Torques of one span; the time counts from its beginning.

    `down` is 1 if the angle counts from the hanging position, -1 if it counts from the inverted one.
    """

    def __init__(self, p: ParameterValues, down: int):
        self.torque, self.rate, self.down = p["T_ext"], p.get("rate", 0.0), down
        self.weight, self.ma = p["m"] * p["g"], p["m"] * p["a"]
        self.moment, self.inertia = self.weight * p["a"], p["J_G"] + p["m"] * p["a"] ** 2
        self.arm, self.has_reaction = p["mu"] * p["r"], p["pin_load"] == REACTION

    def load(self, angle: float, t: float) -> float:
        """Return the torque without friction."""
        return self.torque + self.rate * t - self.down * self.moment * sin(angle)

    def direction(self, load: float) -> int:
        """Return the direction in which the pendulum starts from rest; 0 if friction holds it."""
        return int(copysign(1, load)) if abs(load) > self.arm * self.weight else 0

    def time_to_breakaway(self, load: float) -> float:
        """Return the time in s for which the pendulum stays at rest."""
        return (self.arm * self.weight - copysign(1, self.rate) * load) / abs(self.rate) if self.rate else inf

    def acceleration(self, t: float, angle: float, omega: float, mode: int) -> float:
        """Return the angular acceleration.

        The load on the pin depends on it; the iteration gains at least two digits per pass if the pin is thin.
        """
        load = self.load(angle, t)
        alpha = (load - mode * self.arm * self.weight) / self.inertia
        if self.has_reaction:
            radial = self.down * self.weight * cos(angle) + self.ma * omega * omega
            for _ in range(12):
                normal = hypot(radial, self.down * self.weight * sin(angle) + self.ma * alpha)
                alpha = (load - mode * self.arm * normal) / self.inertia
        return alpha


def integrate_to_standstill(
    pin: PinJoint, mode: int, begin: float, max_duration: float, angle: float, omega: float
) -> tuple[float, float, float, MotionFunction]:
    """Integrate from `begin` (s) to the next standstill, or for `max_duration` (s).

    Returns
    -------
    duration : float
        Duration in s.
    angle, omega : float
        Angle in rad and angular velocity in rad/s at the end.
    motion : callable
        Angle and angular velocity as functions of the time from `begin` on, in s.
    """

    from scipy.integrate import solve_ivp

    def rates(t: float, y: np.ndarray) -> tuple[float, float]:
        return y[1], pin.acceleration(begin + t, y[0], y[1], mode)

    def standstill(_: float, y: np.ndarray) -> float:
        return y[1]

    standstill.terminal, standstill.direction = True, -mode  # type: ignore[attr-defined]
    max_step = 0.02 * 2 * pi * sqrt(pin.inertia / pin.moment) if pin.moment else 0.1 * max_duration
    options = {"rtol": 1e-13, "atol": 1e-18, "max_step": max_step, "dense_output": True}
    run = solve_ivp(rates, (0.0, max_duration), (angle, omega), "DOP853", events=standstill, **options)
    return float(run.t[-1]), float(run.y[0, -1]), 0.0 if run.status == 1 else float(run.y[1, -1]), run.sol


NAME = "pendulum-reaction"
RUN = RunSpec(Path("pendulum.fmu"), ("theta", "omega"))
REACTION_RUN = replace(RUN, values={"pin_load": REACTION})
CASES = (
    ReferenceCase("pendulum", RUN, "hybrid, pin load weight", "pendulum", PendulumProblem()),
    ReferenceCase(NAME, REACTION_RUN, "hybrid, pin load reaction", NAME, PendulumReactionProblem()),
)
