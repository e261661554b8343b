"""Sled pulled through a spring, with LuGre friction: three states, in scalars as the runtime asks for them."""

from math import exp, fabs

from fmus.runtime.codes import ODE45
from fmus.runtime.declare import Choice
from fmus.runtime.march import March
from fmus.runtime.methods import ITEMS
from fmus.runtime.oscillator import Oscillator


class Solver(March):
    method = Choice(ODE45, "integration method", ITEMS)


class Lugre(Oscillator):
    """Bristles that deflect by z.

        m a = k (v_driver t - x) - s0 z - s1 u - s2 v
        u = dz/dt = v - s0 |v| z/g(v),   g = N (mu_d + (mu_s - mu_d) exp(-(v/vs)^2))

    C. Canudas de Wit et al., A new model for control of systems with friction, IEEE Trans. Autom. Control 40 (1995).
    """

    states = {"x": "v", "v": "a", "z": "u"}
    energy = 0.0

    def __init__(self):
        super().__init__()
        self.solver = Solver()
        self.m, self.k, self.v_driver, self.N = 12.5, 742.5, 0.034, 122.6
        self.s0, self.s1, self.s2, self.vs = 1e4, 300.0, 0.4, 1e-2

    def initial(self, t):
        return 0.0, 0.0, 0.0

    def prepare(self):
        return 0

    def rates(self, t, x, v, z):
        curve = self.N * (0.6 + 0.3 * exp(-(v / self.vs) * (v / self.vs)))
        u = v - self.s0 * fabs(v) * z / curve
        return (self.k * (self.v_driver * t - x) - self.s0 * z - self.s1 * u - self.s2 * v) / self.m, u

    def jacobian(self, t, x, v, z):
        fall = 0.3 * exp(-(v / self.vs) * (v / self.vs))
        curve, slope = self.N * (0.6 + fall), -2.0 * v / (self.vs * self.vs) * fall * self.N
        side = 1.0 if v > 0.0 else -1.0
        u_v = 1.0 - self.s0 * side * z / curve + self.s0 * fabs(v) * z / (curve * curve) * slope
        u_z = -self.s0 * fabs(v) / curve
        a_v, a_z = (-self.s1 * u_v - self.s2) / self.m, (-self.s0 - self.s1 * u_z) / self.m
        return self.k * self.v_driver / self.m, -self.k / self.m, a_v, a_z, 0.0, 0.0, u_v, u_z
