"""Compound pendulum with friction in its pin, by scipy's DOP853, restarted at every change of mode or value."""

from collections.abc import Iterator
from math import copysign, cos, hypot, inf, pi, radians, sin, sqrt

import numpy as np

from ..certified_reference import ReferenceCase
from ..ode_problem import JacobianFunction, OdeProblem, RhsFunction, StateVector
from ..segments import MotionFunction, ParameterSpan, ParameterValues, Segment, constant_velocity, shift_time

POUND, INCH = 0.45359237, 0.0254
REACTION = 2  # the number of pin_load = reaction
BEYOND_PI = 1.2246467991473532e-16  # of pi, after what a float holds


class Pendulum(OdeProblem):
    """Compound pendulum with friction in its pin, loaded by the weight."""

    start, stop, unit, has_dry_friction = (radians(10.02), 0.0), 5.0, "rad", True
    m, a, g, r, mu = 0.46 * POUND, 3.7 * INCH, 386 * INCH, 0.25 * INCH, 0.1
    inertia = 1.5 * POUND * INCH**2 + m * a * a

    def rates(self, mode: int) -> RhsFunction:
        swing_to_standstill = self.m * self.g * self.a / self.inertia
        drag = mode * self.mu * self.r * self.m * self.g / self.inertia
        return lambda t, y: (y[1], -swing_to_standstill * sin(y[0]) - drag)

    def jacobian(self, mode: int) -> JacobianFunction | None:
        swing_to_standstill = self.m * self.g * self.a / self.inertia
        return lambda t, y: [[0.0, 1.0], [-swing_to_standstill * cos(y[0]), 0.0]]

    def hold(self, t: float, x: float) -> tuple[float, float, float]:
        return -self.m * self.g * self.a * sin(x), 0.0, self.mu * self.r * self.m * self.g


class Reaction(Pendulum):
    """The pendulum whose pin is loaded by its reaction N, which friction itself changes:

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


def pieces(spans: list[ParameterSpan]) -> Iterator[Segment]:
    """Swings from one standstill to the next, and rests.

    The angle is counted from the nearest of the hanging and the inverted position, so that it keeps its digits there.
    """
    theta, omega = spans[0][2]["theta0"], spans[0][2]["omega0"]
    half_turns = round(theta / pi)
    angle = (theta - half_turns * pi) - half_turns * BEYOND_PI
    for begin, end, p in spans:
        pin, t = PinJoint(p, -1 if half_turns % 2 else 1), begin
        while t < end:
            load = pin.load(angle, t - begin)
            mode = int(copysign(1, omega)) if omega else pin.direction(load)
            if mode == 0:
                yield Segment(t, 0, offset_angle(constant_velocity(angle, 0.0), half_turns * pi))
                t, mode = t + pin.wait(load), int(copysign(1, pin.rate))
                if not t < end:
                    break
            ahead, angle, omega, at = swing_to_standstill(pin, mode, t - begin, end - t, angle, omega)
            yield Segment(t, mode, offset_angle(shift_time(at, t), half_turns * pi))
            t += ahead


def offset_angle(at: MotionFunction, angle: float) -> MotionFunction:
    """A motion with its angle counted from elsewhere."""
    return lambda t: (angle + at(t)[0], at(t)[1])


class PinJoint:
    """The torques of one span, with the time from its beginning; `down` is 1 where the angle is counted from below, -1
    from above."""

    def __init__(self, p: ParameterValues, down: int):
        self.push, self.rate, self.down = p["T_ext"], p.get("rate", 0.0), down
        self.weight, self.ma = p["m"] * p["g"], p["m"] * p["a"]
        self.moment, self.inertia = self.weight * p["a"], p["J_G"] + p["m"] * p["a"] ** 2
        self.arm, self.reaction = p["mu"] * p["r"], p["pin_load"] == REACTION

    def load(self, angle: float, t: float) -> float:
        return self.push + self.rate * t - self.down * self.moment * sin(angle)

    def direction(self, load: float) -> int:
        """Where it goes from rest."""
        return int(copysign(1, load)) if abs(load) > self.arm * self.weight else 0

    def wait(self, load: float) -> float:
        """How long it rests."""
        return (self.arm * self.weight - copysign(1, self.rate) * load) / abs(self.rate) if self.rate else inf

    def acceleration(self, t: float, angle: float, omega: float, mode: int) -> float:
        """The load on the pin depends on the answer: iterated, at least two digits gained a round with thin pins."""
        load = self.load(angle, t)
        alpha = (load - mode * self.arm * self.weight) / self.inertia
        if self.reaction:
            radial = self.down * self.weight * cos(angle) + self.ma * omega * omega
            for _ in range(12):
                normal = hypot(radial, self.down * self.weight * sin(angle) + self.ma * alpha)
                alpha = (load - mode * self.arm * normal) / self.inertia
        return alpha


def swing_to_standstill(
    pin: PinJoint, mode: int, begin: float, longest: float, angle: float, omega: float
) -> tuple[float, float, float, MotionFunction]:
    """To the next standstill, or as long as may be: how long, angle, angular speed and the motion until then."""

    from scipy.integrate import solve_ivp

    def rates(t: float, y: np.ndarray) -> tuple[float, float]:
        return y[1], pin.acceleration(begin + t, y[0], y[1], mode)

    def still(_: float, y: np.ndarray) -> float:
        return y[1]

    still.terminal, still.direction = True, -mode  # type: ignore[attr-defined]
    step = 0.02 * 2 * pi * sqrt(pin.inertia / pin.moment) if pin.moment else 0.1 * longest
    options = {"rtol": 1e-13, "atol": 1e-18, "max_step": step, "dense_output": True}
    run = solve_ivp(rates, (0.0, longest), (angle, omega), "DOP853", events=still, **options)
    return float(run.t[-1]), float(run.y[0, -1]), 0.0 if run.status == 1 else float(run.y[1, -1]), run.sol


NAME, SWING = "pendulum-reaction", ("theta", "omega")
CASES = (
    ReferenceCase("pendulum", "pendulum", "hybrid, pin load weight", "pendulum", Pendulum(), outputs=SWING),
    ReferenceCase(
        NAME, "pendulum", "hybrid, pin load reaction", NAME, Reaction(), {"pin_load": REACTION}, outputs=SWING
    ),
)
