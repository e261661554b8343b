"""Drag sled with a smooth friction curve."""

from math import asin, atan, cos, pi, sin, tan

from .runtime.codes import RODAS
from .runtime.declare import Choice, Fixed, Input, Output, Parameter
from .runtime.march import March
from .runtime.methods import ITEMS
from .runtime.oscillator import Oscillator


class Solver(March):
    method = Choice(RODAS, "integration method", ITEMS)


class Pacejka(Oscillator):
    """Drag sled with the smooth friction curve of Pacejka's magic formula; it creeps where the sled sticks.

        m a = F_ext + k (x_driver - x) - F_friction,   d(x_driver)/dt = v_driver
        F_friction = mu(v) m g,   mu(v) = D sin(C atan(B v - E (B v - atan(B v))))
        D = mu_s,   C = 2 - 2 asin(mu_d/D)/pi,   B = 2 mu_s/(x_m C D),
        E = (B x_m - tan(pi/(2 C)))/(B x_m - atan(B x_m))

    The curve has its peak mu_s at the speed x_m and tends to mu_d.
    H. B. Pacejka, Tire and Vehicle Dynamics, section 4.3.
    """

    m = Parameter(12.5, "kg", "mass of the sled", above=0.0)
    k = Parameter(742.5, "N/m", "stiffness of the spring", low=0.0)
    mu_s = Parameter(0.9, "1", "peak of the friction coefficient", above=0.0)
    mu_d = Parameter(0.6, "1", "coefficient of friction at high speed", low=0.0)
    g = Parameter(9.81, "m/s2", "gravity", low=0.0)
    v_driver = Parameter(0.034, "m/s", "speed of the driver")
    x_m = Parameter(0.01, "m/s", "speed at the peak of the friction curve", above=0.0)
    x0 = Fixed(0.0, "m", "position at the start")
    v0 = Fixed(0.0, "m/s", "speed at the start")
    F_ext = Input(0.0, "N", "outer force on the sled")
    x = Output("m", "position of the sled")
    v = Output("m/s", "speed of the sled")
    a = Output("m/s2", "acceleration of the sled", direct=True)
    x_driver = Output("m", "position of the driver, zero at the start")
    F_spring = Output("N", "force of the spring on the sled")
    F_friction = Output("N", "force of friction, against the motion")
    energy = Output("J", "kinetic and potential energy", low=0.0)

    driven = True
    stop_time = 16.0
    step_size = 0.016
    tolerance = 2e-7  # a position error shifts the next break-away: the speed loses a digit more
    rules = (
        "mu_d is {mu_d!r}, not below mu_s = {mu_s!r}: at mu_d = mu_s the factor C is 1 and no finite E puts the peak "
        "of the curve at x_m; lower mu_d or raise mu_s",
    )

    def __init__(self):
        super().__init__()
        self.solver = Solver()
        self.t_base = self.x_base = 0.0
        self.B = self.C = self.D = self.E = self.weight = 0.0

    def initial(self, t):
        self.t_base, self.x_base = t, 0.0
        return self.x0, self.v0

    def prepare(self):
        if self.mu_d >= self.mu_s:
            return 1
        self.weight = self.m * self.g
        self.D = self.mu_s
        self.C = 2.0 - 2.0 * asin(self.mu_d / self.D) / pi
        self.B = 2.0 * self.mu_s / (self.x_m * self.C * self.D)
        peak = self.B * self.x_m
        self.E = (peak - tan(0.5 * pi / self.C)) / (peak - atan(peak))
        return 0

    def mu(self, v):
        z = self.B * v
        return self.D * sin(self.C * atan(z - self.E * (z - atan(z))))

    def finest(self):
        return self.x_m

    def rates(self, t, x, v, mode):
        pull = self.F_ext + self.k * (self.x_base + self.v_driver * (t - self.t_base) - x)
        return pull / self.m - self.mu(v) * self.g

    def jacobian(self, t, x, v, mode):
        z = self.B * v
        y = z - self.E * (z - atan(z))
        slope = self.B - self.E * (self.B - self.B / (1.0 + z * z))
        slope = self.D * (cos(self.C * atan(y)) * (self.C * (slope / (1.0 + y * y))))
        return self.k * self.v_driver / self.m, -self.k / self.m, -slope * self.g

    def observe(self, t, x, v, mode):
        driver = self.x_base + self.v_driver * (t - self.t_base)
        stretch, mu = driver - x, self.mu(v)
        spring = self.k * stretch
        self.x, self.v, self.x_driver = x, v, driver
        self.F_spring, self.F_friction = spring, mu * self.weight
        self.a = (self.F_ext + spring) / self.m - mu * self.g
        self.energy = 0.5 * (self.m * v * v + spring * stretch)
