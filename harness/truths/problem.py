"""The oscillators as the user of another solver writes them: equations and modes, typed apart from the FMUs.

    d(x, v)/dt = rates(mode)(t, (x, v)),    mode = -1 sliding backward, 0 stuck, 1 sliding forward

A dry problem slides in one mode until v = 0, then goes where `settle` says; stuck, it waits for `release`.
SI units throughout.
"""

from collections.abc import Callable, Sequence
from math import asin, atan, copysign, cos, fabs, inf, pi, radians, sin, sqrt, tan

import numpy as np

State = Sequence[float] | np.ndarray
Rates = Callable[[float, State], tuple[float, float]]
Jacobian = Callable[[float, State], list[list[float]]]

POUND, INCH = 0.45359237, 0.0254


class Equations:
    """One run from `start` (position in `unit`, and speed) at t = 0 to `stop` (s); `absolute` is the tolerance below
    which errors do not matter, as a share of the relative one."""

    start: tuple[float, float]
    stop: float
    unit = "m"
    dry = stiff = False
    absolute = 1e-3  # SI units

    def rates(self, mode: int) -> Rates:
        """The right-hand side in a mode of sliding."""
        raise NotImplementedError

    def jacobian(self, mode: int) -> Jacobian | None:
        """Its derivatives by the state; None leaves them to the solver."""
        raise NotImplementedError

    def hold(self, t: float, x: float) -> tuple[float, float, float]:
        """Load on the body at rest, its rate, and what friction can hold."""
        raise NotImplementedError

    def mode_from(self, t: float, x: float, v: float) -> int:
        """The mode that holds from here on."""
        if not self.dry:
            return 1
        load, _, limit = self.hold(t, x)
        return int(copysign(1, v)) if v else int(copysign(1, load)) if abs(load) > limit else 0

    def release(self, t: float, x: float) -> tuple[float, int]:
        """When a stuck body breaks away, and in which direction; the load is linear in time."""
        load, rate, limit = self.hold(t, x)
        direction = int(copysign(1, rate))
        return (t + (limit - direction * load) / abs(rate), direction) if rate else (inf, 0)


class Unwritten(Equations):
    """A model that nobody has written a second time: there is nothing to ask a peer."""

    def __init__(self, stop: float) -> None:
        self.stop = stop


class Smd(Equations):
    """Spring, mass and viscous damper."""

    start, stop = (0.1, 0.0), 4.0

    def rates(self, mode: int) -> Rates:
        return lambda t, y: (y[1], -157.9 * y[0] - 2.0 * y[1])

    def jacobian(self, mode: int) -> Jacobian:
        matrix = [[0.0, 1.0], [-157.9, -2.0]]
        return lambda t, y: matrix


class Coulomb(Equations):
    """Spring and mass with Coulomb friction."""

    start, stop, dry = (0.1, 0.0), 4.0, True

    def __init__(self, m: float = 1.0, k: float = 157.9, f: float = 0.5) -> None:
        self.m, self.k, self.f = m, k, f

    def rates(self, mode: int) -> Rates:
        square, drag = self.k / self.m, mode * self.f / self.m
        return lambda t, y: (y[1], -square * y[0] - drag)

    def jacobian(self, mode: int) -> Jacobian | None:
        matrix = [[0.0, 1.0], [-self.k / self.m, 0.0]]
        return lambda t, y: matrix

    def hold(self, t: float, x: float) -> tuple[float, float, float]:
        return -self.k * x, 0.0, self.f


class Classic(Coulomb):
    """The chattering classic: strong friction stops the mass within half a second, and holds it."""

    start, stop = (0.0, 5.0), 10.0 * pi

    def __init__(self) -> None:
        super().__init__(1.0, 1.0, 10.0)


class Plain(Classic):
    """The classic with sign(v) as it stands: one equation, no modes, and no end."""

    dry = False

    def rates(self, mode: int) -> Rates:
        return lambda t, y: (y[1], -y[0] - (copysign(10.0, y[1]) if y[1] else 0.0))

    def jacobian(self, mode: int) -> None:
        return None


class Stickslip(Equations):
    """Drag sled pulled through a spring."""

    start, stop, dry = (0.0, 0.0), 16.0, True
    m, k, g, mu_s, mu_d, v_driver = 12.5, 742.5, 9.81, 0.9, 0.6, 0.034

    def rates(self, mode: int) -> Rates:
        square, drag, speed = self.k / self.m, mode * self.mu_d * self.g, self.v_driver
        return lambda t, y: (y[1], square * (speed * t - y[0]) - drag)

    def jacobian(self, mode: int) -> Jacobian | None:
        matrix = [[0.0, 1.0], [-self.k / self.m, 0.0]]
        return lambda t, y: matrix

    def hold(self, t: float, x: float) -> tuple[float, float, float]:
        return self.k * (self.v_driver * t - x), self.k * self.v_driver, self.mu_s * self.m * self.g


class Pacejka(Stickslip):
    """The sled with the magic formula: one smooth equation, no modes."""

    dry, stiff = False, True

    def __init__(self, x_m: float = 0.01) -> None:
        self.absolute = min(x_m, Equations.absolute)  # the curve is as fine as that
        self.D = self.mu_s
        self.C = 1 + (1 - 2 * asin(self.mu_d / self.D) / pi)
        self.B = self.mu_s / (x_m / 2) / (self.C * self.D)
        self.E = (self.B * x_m - tan(pi / (2 * self.C))) / (self.B * x_m - atan(self.B * x_m))

    def rates(self, mode: int) -> Rates:
        square, speed, weight = self.k / self.m, self.v_driver, self.D * self.g
        B, C, E = self.B, self.C, self.E

        def rates(t: float, y: State) -> tuple[float, float]:
            x, v = y
            z = B * v
            return v, square * (speed * t - x) - weight * sin(C * atan(z - E * (z - atan(z))))

        return rates

    def jacobian(self, mode: int) -> Jacobian:
        square, weight = self.k / self.m, self.D * self.g
        B, C, E = self.B, self.C, self.E

        def jacobian(t: float, y: State) -> list[list[float]]:
            z = B * y[1]
            u = z - E * (z - atan(z))
            slope = weight * cos(C * atan(u)) * C / (1 + u * u) * B * (1 - E + E / (1 + z * z))
            return [[0.0, 1.0], [-square, -slope]]

        return jacobian


class Pendulum(Equations):
    """Compound pendulum with friction in its pin, loaded by the weight."""

    start, stop, unit, dry = (radians(10.02), 0.0), 5.0, "rad", True
    m, a, g, r, mu = 0.46 * POUND, 3.7 * INCH, 386 * INCH, 0.25 * INCH, 0.1
    inertia = 1.5 * POUND * INCH**2 + m * a * a

    def rates(self, mode: int) -> Rates:
        swing = self.m * self.g * self.a / self.inertia
        drag = mode * self.mu * self.r * self.m * self.g / self.inertia
        return lambda t, y: (y[1], -swing * sin(y[0]) - drag)

    def jacobian(self, mode: int) -> Jacobian | None:
        swing = self.m * self.g * self.a / self.inertia
        return lambda t, y: [[0.0, 1.0], [-swing * cos(y[0]), 0.0]]

    def hold(self, t: float, x: float) -> tuple[float, float, float]:
        return -self.m * self.g * self.a * sin(x), 0.0, self.mu * self.r * self.m * self.g


class Reaction(Pendulum):
    """The pendulum whose pin is loaded by its reaction N, which friction itself changes:

    N^2 = R^2 + (b - mode s N)^2,    R = m g cos(x) + m a v^2,    b = m g sin(x) (1 - m a^2/J),    s = mu r m a/J
    """

    def rates(self, mode: int) -> Rates:
        weight, moment, arm = self.m * self.g, self.m * self.a, self.mu * self.r
        share = 1 - moment * self.a / self.inertia
        s = mode * arm * moment / self.inertia
        rest = 1 - s * s

        def rates(t: float, y: State) -> tuple[float, float]:
            x, v = y
            radial, b = weight * cos(x) + moment * v * v, weight * sin(x) * share
            normal = (sqrt(b * b + rest * radial * radial) - s * b) / rest
            return v, -(weight * self.a * sin(x) + mode * arm * normal) / self.inertia

        return rates

    def jacobian(self, mode: int) -> None:
        return None


class Belt(Equations):
    """Block on a belt (R. I. Leine, Bifurcations in Discontinuous Mechanical Systems of Filippov-Type, 2000).

    m = k = F_s = 1 in SI units; seen from the belt, y = x - 0.2 t, the block sticks where its speed is zero:

    y'' = -(y + 0.2 t) - sign(v)/(1 + 3 |v|),    stuck while |y + 0.2 t| <= 1
    """

    start, stop, dry = (1.067, -0.2), 50.0, True

    def rates(self, mode: int) -> Rates:
        return lambda t, y: (y[1], -(y[0] + 0.2 * t) - mode / (1 + 3 * mode * y[1]))

    def jacobian(self, mode: int) -> Jacobian | None:
        return lambda t, y: [[0.0, 1.0], [-1.0, 3 / (1 + 3 * mode * y[1]) ** 2]]

    def hold(self, t: float, x: float) -> tuple[float, float, float]:
        return -(x + 0.2 * t), -0.2, 1.0


class Smoothed(Belt):
    """The block on a belt, its jump of friction smoothed to a steep arctan: it creeps where it should stick."""

    dry = False
    steepness = 1e6  # s/m

    def rates(self, mode: int) -> Rates:
        share, steepness = 2 / pi, self.steepness
        return lambda t, y: (
            y[1],
            -(y[0] + 0.2 * t) - share * atan(steepness * y[1]) / (1 + 3 * fabs(y[1])),
        )

    def jacobian(self, mode: int) -> None:
        return None
