"""Independent solution of the pendulum: DOP853 at 1e-13 with short steps, restarted at every change of mode.

    (J_G + m a^2) alpha = T_ext - m g a sin(theta) - mu r N sign(omega)
    N = m g, or the magnitude of (m g cos(theta) + m a omega^2, m g sin(theta) + m a alpha)

There is no closed form. This solution shares neither method nor code with the FMU and is accurate to about 1e-12 rad.
"""

from bisect import bisect_right
from math import copysign, cos, hypot, radians, sin

from scipy.integrate import solve_ivp

POUND, INCH = 0.45359237, 0.0254
DEFAULTS = {
    "m": 0.46 * POUND,
    "a": 3.7 * INCH,
    "J_G": 1.5 * POUND * INCH**2,
    "g": 386 * INCH,
    "mu": 0.1,
    "r": 0.25 * INCH,
    "T_ext": 0.0,
}
THETA0 = radians(10.02)


class Pendulum:
    """The equations for one set of parameters; `reaction` computes the pin load from the motion."""

    def __init__(self, reaction=False, **values):
        self.reaction = reaction
        self.m, self.a, self.J_G, self.g, self.mu, self.r, self.T_ext = {**DEFAULTS, **values}.values()
        self.inertia = self.J_G + self.m * self.a**2

    def load(self, theta):
        return self.T_ext - self.m * self.g * self.a * sin(theta)

    def acceleration(self, theta, omega, mode):
        """Return the angular acceleration; a pin load that depends on it is found by fixed-point iteration."""
        alpha, normal, weight = 0.0, self.m * self.g, self.m * self.g
        for _ in range(12):  # each iteration gains two digits for thin pins
            if self.reaction:
                radial = weight * cos(theta) + self.m * self.a * omega**2
                normal = hypot(radial, weight * sin(theta) + self.m * self.a * alpha)
            alpha = (self.load(theta) - mode * self.mu * self.r * normal) / self.inertia
        return alpha

    def direction(self, theta):
        """Return the direction of motion from rest, where the pin carries the weight."""
        load = self.load(theta)
        return int(copysign(1, load)) if abs(load) > self.mu * self.r * self.m * self.g else 0


class PendulumMotion:
    """The motion over spans of (time, Pendulum) up to `stop`; `events` lists (time, new mode)."""

    def __init__(self, spans, theta, omega, stop):
        self.starts, self.modes, self.parts, self.events = [], [], [], []
        for (t, pendulum), end in zip(spans, [t for t, _ in spans[1:]] + [stop], strict=True):
            mode = int(copysign(1, omega)) if omega else pendulum.direction(theta)
            while t < end:
                if self.modes and mode != self.modes[-1]:
                    self.events.append((t, mode))
                self.starts.append(t)
                self.modes.append(mode)
                if mode == 0:
                    self.parts.append(lambda _, rest=theta: (rest, 0.0))
                    break
                t, theta, omega, solution = integrate_to_turning_point(pendulum, mode, t, end, theta, omega)
                self.parts.append(solution)
                if omega == 0.0:
                    mode = pendulum.direction(theta)

    def at(self, t):
        """Return angle and angular speed at time t."""
        return tuple(self.parts[max(bisect_right(self.starts, t) - 1, 0)](t))


def integrate_to_turning_point(pendulum, mode, t, end, theta, omega):
    """Integrate to the next turning point or the end; return time, angle, angular speed and the dense solution."""

    def rates(_, y):
        return y[1], pendulum.acceleration(y[0], y[1], mode)

    def turning_speed(_, y):
        return y[1]

    turning_speed.terminal, turning_speed.direction = True, -mode
    run = solve_ivp(
        rates,
        (t, end),
        (theta, omega),
        "DOP853",
        events=turning_speed,
        rtol=1e-13,
        atol=1e-16,
        max_step=0.01,
        dense_output=True,
    )
    return float(run.t[-1]), float(run.y[0, -1]), 0.0 if run.status == 1 else float(run.y[1, -1]), run.sol
