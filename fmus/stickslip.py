"""Drag sled pulled through a spring."""

from math import fabs

from .runtime.automaton import HYBRID_LAW, THRESHOLD_LAW, DryFriction, sign
from .runtime.codes import EXACT, HYBRID
from .runtime.declare import Choice, Fixed, Input, Mode, Output, Parameter
from .runtime.exact import Exact
from .runtime.march import March
from .runtime.methods import EXACT_ITEM, ITEMS


class Solver(March):
    method = Choice(EXACT, "integration method", (EXACT_ITEM, *ITEMS))


class Stickslip(DryFriction):
    """Drag sled pulled through a spring by a driver of constant speed: stick-slip.

        m a = F_ext + k (x_driver - x) - F_friction,   d(x_driver)/dt = v_driver
        sliding:   F_friction = mu_d m g sign(v)
        stuck:     v = 0 while |F_ext + k (x_driver - x)| <= mu_s m g

    E. Rabinowicz, Friction and Wear of Materials, chapter 4.
    """

    m = Parameter(12.5, "kg", "mass of the sled", above=0.0)
    k = Parameter(742.5, "N/m", "stiffness of the spring", low=0.0)
    mu_s = Parameter(0.9, "1", "coefficient of static friction", low=0.0)
    mu_d = Parameter(0.6, "1", "coefficient of sliding friction", low=0.0)
    g = Parameter(9.81, "m/s2", "gravity", low=0.0)
    v_driver = Parameter(0.034, "m/s", "speed of the driver")
    eps = Parameter(1e-7, "m/s", "speed below which the threshold law holds the sled", above=0.0)
    x0 = Fixed(0.0, "m", "position at the start")
    v0 = Fixed(0.0, "m/s", "speed at the start")
    friction = Choice(HYBRID, "friction law", (HYBRID_LAW, THRESHOLD_LAW))
    F_ext = Input(0.0, "N", "outer force on the sled")
    x = Output("m", "position of the sled")
    v = Output("m/s", "speed of the sled")
    a = Output("m/s2", "acceleration of the sled", direct=True)
    x_driver = Output("m", "position of the driver, zero at the start")
    F_spring = Output("N", "force of the spring on the sled")
    F_friction = Output("N", "force of friction, against the motion", direct=True)
    energy = Output("J", "kinetic and potential energy", low=0.0)
    mode = Mode("-1 sliding backward, 0 stuck, 1 sliding forward")

    linear = True
    driven = True
    stop_time = 16.0
    step_size = 0.016
    rules = (
        *DryFriction.rules,
        "mu_d is {mu_d!r}, above mu_s = {mu_s!r}: sliding friction cannot exceed static friction; "
        "lower mu_d or raise mu_s",
    )

    def __init__(self):
        super().__init__()
        self.solver = Solver()
        self.exact = Exact()
        self.t_base = self.x_base = 0.0
        self.sliding = self.holding = 0.0

    def initial(self, t):
        self.t_base, self.x_base = t, 0.0
        return self.x0, self.v0

    def prepare(self):
        self.sliding, self.holding = self.mu_d * self.m * self.g, self.mu_s * self.m * self.g
        self.exact.prepare(self.m, 0.0, self.k, self.v_driver)
        return 2 if self.mu_d > self.mu_s else super().prepare()

    def pull(self, t, x):
        """Force on the sled but for friction."""
        return self.F_ext + self.k * (self.x_base + self.v_driver * (t - self.t_base) - x)

    def rates(self, t, x, v, mode):
        pull = self.pull(t, x)
        return (pull - (mode * self.sliding if mode != 0 else self.threshold(pull, v))) / self.m

    def jacobian(self, t, x, v, mode):
        if mode == 0 and fabs(v) < self.eps and fabs(self.pull(t, x)) <= self.holding:
            return 0.0, 0.0, 0.0
        return self.k * self.v_driver / self.m, -self.k / self.m, 0.0

    def threshold(self, pull, v):
        """Friction by the threshold law."""
        if fabs(v) >= self.eps:
            return sign(v) * self.sliding
        return self.holding if pull > self.holding else -self.holding if pull < -self.holding else pull

    def push(self, t, mode):
        return (self.pull(t, 0.0) - mode * self.sliding) / self.m

    def hold(self, t, x, v):
        return self.pull(t, x), self.k * self.v_driver, self.holding

    def terms(self, t, x, v):
        ways = fabs(x) + fabs(self.x_base) + fabs(self.v_driver) * (fabs(t) + fabs(self.t_base))
        return fabs(self.F_ext) + self.k * ways

    def departure(self, t, x, v, mode):
        return mode * (self.holding - self.sliding) / self.m

    def observe(self, t, x, v, mode):
        driver = self.x_base + self.v_driver * (t - self.t_base)
        spring = self.k * (driver - x)
        pull = self.F_ext + spring
        self.x, self.v, self.x_driver = x, v, driver
        self.F_spring, self.mode = spring, mode
        if mode != 0:
            self.F_friction = mode * self.sliding
        elif self.friction == HYBRID:
            self.F_friction = pull
        else:
            self.F_friction = self.threshold(pull, v)
            self.mode = sign(v) if fabs(v) >= self.eps else 0
        self.a = (pull - self.F_friction) / self.m
        self.energy = 0.5 * (self.m * v * v + spring * (driver - x))
