"""The models without a closed form, by scipy.

pacejka     Radau, with the slope of the friction curve, restarted where a value changes
pendulum    DOP853, restarted at every change of mode or value
"""

from collections.abc import Iterator
from math import asin, atan, copysign, cos, hypot, pi, sin, sqrt, tan

import numpy as np
from scipy.integrate import solve_ivp

from .pieces import Course, Piece, Span, Values

REACTION = 2  # the number of pin_load = reaction
BEYOND_PI = 1.2246467991473532e-16  # of pi, after what a float holds


def pacejka(spans: list[Span]) -> Iterator[Piece]:
    """m a = F_ext + k (x_driver - x) - mu(v) m g, in one piece from each change of values on."""
    y, drive = [spans[0][2]["x0"], spans[0][2]["v0"]], 0.0
    for begin, end, p in spans:
        curve = Curve(p)

        def rates(
            s: float, y: np.ndarray, p: Values = p, curve: Curve = curve, drive: float = drive
        ) -> tuple[float, float]:
            pull = p["F_ext"] + p["k"] * (drive + p["v_driver"] * s - y[0])
            return y[1], pull / p["m"] - curve.mu(y[1]) * p["g"]

        def slopes(s: float, y: np.ndarray, p: Values = p, curve: Curve = curve) -> list[list[float]]:
            return [[0.0, 1.0], [-p["k"] / p["m"], -curve.slope(y[1]) * p["g"]]]

        # in the time from the beginning of the span, which has finer digits than that of the clock
        run = solve_ivp(rates, (0.0, end - begin), y, "Radau", jac=slopes, rtol=1e-11, atol=1e-15, dense_output=True)
        yield Piece(begin, 1, later(run.sol, begin))
        y, drive = run.y[:, -1], drive + p["v_driver"] * (end - begin)


def later(at: Course, origin: float) -> Course:
    """A motion with its time counted from elsewhere."""
    return lambda t: at(t - origin)


class Curve:
    """The magic formula: mu and its slope at a speed."""

    def __init__(self, p: Values):
        self.D, self.C = p["mu_s"], 1 + (1 - 2 * asin(p["mu_d"] / p["mu_s"]) / pi)
        self.B = (p["mu_s"] / (p["x_m"] / 2)) / (self.C * self.D)
        top = self.B * p["x_m"]
        self.E = (top - tan(pi / (2 * self.C))) / (top - atan(top))

    def mu(self, v: float) -> float:
        bv = self.B * v
        return self.D * sin(self.C * atan(bv - self.E * (bv - atan(bv))))

    def slope(self, v: float) -> float:
        bv = self.B * v
        inner = bv - self.E * (bv - atan(bv))
        rise = self.B * (1 - self.E * bv * bv / (1 + bv * bv))
        return self.D * self.C * cos(self.C * atan(inner)) * rise / (1 + inner * inner)


def pendulum(spans: list[Span]) -> Iterator[Piece]:
    """Swings from one standstill to the next, and rests.

    The angle is counted from the nearest of the hanging and the inverted position, so that it keeps its digits there.
    """
    theta, omega = spans[0][2]["theta0"], spans[0][2]["omega0"]
    half_turns = round(theta / pi)
    angle = (theta - half_turns * pi) - half_turns * BEYOND_PI
    for begin, end, p in spans:
        pin, t = Pin(p, -1 if half_turns % 2 else 1), begin
        while t < end:
            mode = int(copysign(1, omega)) if omega else pin.direction(angle)
            if mode == 0:
                yield Piece(t, 0, turned(resting(angle), half_turns * pi))
                break
            ahead, angle, omega, at = swing(pin, mode, end - t, angle, omega)
            yield Piece(t, mode, turned(later(at, t), half_turns * pi))
            t += ahead


def turned(at: Course, angle: float) -> Course:
    """A motion with its angle counted from elsewhere."""
    return lambda t: (angle + at(t)[0], at(t)[1])


def resting(angle: float) -> Course:
    return lambda t: (angle, 0.0)


class Pin:
    """The torques of one span; `down` is 1 where the angle is counted from below, -1 from above."""

    def __init__(self, p: Values, down: int):
        self.push, self.weight, self.ma, self.down = p["T_ext"], p["m"] * p["g"], p["m"] * p["a"], down
        self.moment, self.inertia = self.weight * p["a"], p["J_G"] + p["m"] * p["a"] ** 2
        self.arm, self.reaction = p["mu"] * p["r"], p["pin_load"] == REACTION

    def load(self, angle: float) -> float:
        return self.push - self.down * self.moment * sin(angle)

    def direction(self, angle: float) -> int:
        """Where it goes from rest."""
        load = self.load(angle)
        return int(copysign(1, load)) if abs(load) > self.arm * self.weight else 0

    def acceleration(self, angle: float, omega: float, mode: int) -> float:
        """The load on the pin depends on the answer: iterated, at least two digits gained a round with thin pins."""
        load = self.load(angle)
        alpha = (load - mode * self.arm * self.weight) / self.inertia
        if self.reaction:
            radial = self.down * self.weight * cos(angle) + self.ma * omega * omega
            for _ in range(12):
                normal = hypot(radial, self.down * self.weight * sin(angle) + self.ma * alpha)
                alpha = (load - mode * self.arm * normal) / self.inertia
        return alpha


def swing(pin: Pin, mode: int, longest: float, angle: float, omega: float) -> tuple[float, float, float, Course]:
    """To the next standstill, or as long as may be: how long, angle, angular speed and the motion until then."""

    def rates(_: float, y: np.ndarray) -> tuple[float, float]:
        return y[1], pin.acceleration(y[0], y[1], mode)

    def still(_: float, y: np.ndarray) -> float:
        return y[1]

    still.terminal, still.direction = True, -mode  # type: ignore[attr-defined]
    step = 0.02 * 2 * pi * sqrt(pin.inertia / pin.moment) if pin.moment else 0.1 * longest
    options = {"rtol": 1e-13, "atol": 1e-18, "max_step": step, "dense_output": True}
    run = solve_ivp(rates, (0.0, longest), (angle, omega), "DOP853", events=still, **options)
    return float(run.t[-1]), float(run.y[0, -1]), 0.0 if run.status == 1 else float(run.y[1, -1]), run.sol
