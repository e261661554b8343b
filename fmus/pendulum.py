"""Compound pendulum with friction in its pin."""

from math import cos, fabs, radians, sin, sqrt

from .runtime.automaton import HYBRID_LAW, SIGN_LAW, DryFriction, sign
from .runtime.codes import DOP853, HYBRID
from .runtime.declare import Choice, Fixed, Input, Mode, Output, Parameter
from .runtime.march import March
from .runtime.methods import ITEMS

POUND, INCH = 0.45359237, 0.0254
WEIGHT, REACTION = 1, 2


class Solver(March):
    method = Choice(DOP853, "integration method", ITEMS)


class Pendulum(DryFriction):
    """Compound pendulum with dry friction in its pin.

        J alpha = T_ext - m g a sin(theta) - T_friction,   J = J_G + m a^2
        sliding:   T_friction = mu r N sign(omega)
        stuck:     omega = 0 while |T_ext - m g a sin(theta)| <= mu r m g
        pin_load weight:     N = m g
        pin_load reaction:   N^2 = (m g cos(theta) + m a omega^2)^2 + (m g sin(theta) + m a alpha)^2

    At rest the pin carries the weight, so both loads hold the same torque.
    """

    m = Parameter(0.46 * POUND, "kg", "mass", above=0.0)
    a = Parameter(3.7 * INCH, "m", "distance from the pin to the centre of mass", low=0.0)
    J_G = Parameter(1.5 * POUND * INCH * INCH, "kg.m2", "moment of inertia about the centre of mass", low=0.0)
    g = Parameter(386.0 * INCH, "m/s2", "gravity", low=0.0)
    mu = Parameter(0.1, "1", "coefficient of friction in the pin", low=0.0)
    r = Parameter(0.25 * INCH, "m", "radius of the pin", low=0.0)
    theta0 = Fixed(radians(10.02), "rad", "angle at the start, zero hanging down", display="deg")
    omega0 = Fixed(0.0, "rad/s", "angular speed at the start", display="deg/s")
    friction = Choice(HYBRID, "friction law", (HYBRID_LAW, SIGN_LAW))
    pin_load = Choice(
        WEIGHT,
        "load on the pin",
        (("weight", WEIGHT, "the weight"), ("reaction", REACTION, "the magnitude of the pin reaction")),
    )
    T_ext = Input(0.0, "N.m", "outer torque on the pendulum")
    theta = Output("rad", "angle, zero hanging down", display="deg")
    omega = Output("rad/s", "angular speed", display="deg/s")
    alpha = Output("rad/s2", "angular acceleration", direct=True, display="deg/s2")
    T_friction = Output("N.m", "torque of friction in the pin, against the motion", direct=True)
    energy = Output("J", "kinetic and potential energy, zero at rest hanging down", low=0.0)
    mode = Mode("-1 sliding backward, 0 stuck, 1 sliding forward")

    stop_time = 5.0
    step_size = 0.005
    tolerance = 1e-10
    rules = (
        *DryFriction.rules,
        "J_G + m a^2 is zero: a pendulum needs inertia; raise J_G or a",
        "mu r is {mu!r}*{r!r} m, too much for pin_load = 2 (reaction): the friction torque would outgrow the inertia "
        "(mu r m a must be below J_G + m a^2); lower mu or r, or set pin_load to 1 (weight)",
    )

    def __init__(self):
        super().__init__()
        self.solver = Solver()
        self.J = self.weight = self.moment = self.arm = self.share = 0.0

    def initial(self, t):
        return self.theta0, self.omega0

    def prepare(self):
        self.J = self.J_G + self.m * self.a * self.a
        self.weight = self.m * self.g
        self.moment = self.weight * self.a
        self.arm = self.mu * self.r
        if self.J <= 0.0:
            return 2
        self.share = self.arm * self.m * self.a / self.J
        if self.pin_load == REACTION and self.share >= 1.0:
            return 3
        return super().prepare()

    def reaction(self, load, x, v, mode):
        """Reaction of the pin, N, while it slides: it obeys N^2 = R^2 + (b - mode share N)^2."""
        radial = self.weight * cos(x) + self.m * self.a * v * v
        b = self.weight * sin(x) + self.m * self.a * load / self.J
        rest = 1.0 - self.share * self.share
        return (sqrt(b * b + rest * radial * radial) - mode * self.share * b) / rest

    def rates(self, t, x, v, mode):
        if mode == 0:
            mode = sign(v)
        load = self.T_ext - self.moment * sin(x)
        pin = self.weight if self.pin_load == WEIGHT else self.reaction(load, x, v, mode)
        return (load - mode * self.arm * pin) / self.J

    def jacobian(self, t, x, v, mode):
        if mode == 0:
            mode = sign(v)
        load_x = -self.moment * cos(x)
        if self.pin_load == WEIGHT:
            return 0.0, load_x / self.J, 0.0
        radial = self.weight * cos(x) + self.m * self.a * v * v
        b = self.weight * sin(x) + self.m * self.a * (self.T_ext - self.moment * sin(x)) / self.J
        b_x = self.weight * cos(x) + self.m * self.a * load_x / self.J
        rest = 1.0 - self.share * self.share
        root = sqrt(b * b + rest * radial * radial)
        r_x, r_v = -self.weight * sin(x), self.m * self.a * v + self.m * self.a * v
        root_x = 0.5 * (2.0 * b * b_x + (rest * r_x * radial + rest * radial * r_x)) / root if root > 0.0 else 0.0
        root_v = 0.5 * (rest * r_v * radial + rest * radial * r_v) / root if root > 0.0 else 0.0
        n_x, n_v = (root_x - mode * self.share * b_x) / rest, root_v / rest
        return 0.0, (load_x - mode * (self.arm * n_x)) / self.J, -mode * (self.arm * n_v) / self.J

    def hold(self, t, x, v):
        return self.T_ext - self.moment * sin(x), 0.0, self.arm * self.weight

    def terms(self, t, x, v):
        return fabs(self.T_ext) + self.moment * fabs(x)

    def observe(self, t, x, v, mode):
        load = self.T_ext - self.moment * sin(x)
        self.theta, self.omega = x, v
        if mode == 0 and self.friction == HYBRID:
            self.mode, self.T_friction, self.alpha = 0, load, 0.0
        else:
            if mode == 0:
                mode = sign(v)
            pin = self.weight if self.pin_load == WEIGHT else self.reaction(load, x, v, mode)
            friction = mode * self.arm * pin
            self.mode, self.T_friction, self.alpha = mode, friction, (load - friction) / self.J
        half = sin(0.5 * x)
        self.energy = 0.5 * self.J * v * v + 2.0 * self.moment * half * half
