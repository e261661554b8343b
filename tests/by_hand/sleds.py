"""Two sleds in a row, pulled through a spring, each with stick and slip: two contacts on bodies of their own."""

from math import fabs

from fmus.runtime.automaton import DryFriction
from fmus.runtime.codes import HYBRID, ODE45
from fmus.runtime.declare import Choice
from fmus.runtime.march import March
from fmus.runtime.methods import ITEMS


class Solver(March):
    method = Choice(ODE45, "integration method", ITEMS)


class Sleds(DryFriction):
    """Two sleds.

    m1 a1 = k (v_driver t - x1) - link (x1 - x2) - F1,   m2 a2 = link (x1 - x2) - F2
    """

    states = {"x1": "v1", "v1": "a1", "x2": "v2", "v2": "a2"}
    contacts = {"mode1": "v1", "mode2": "v2"}
    friction = HYBRID

    def __init__(self):
        super().__init__()
        self.solver = Solver()
        self.m1, self.m2, self.k, self.link, self.v_driver = 12.5, 8.0, 742.5, 1100.0, 0.034
        self.slide1, self.slide2, self.hold1, self.hold2 = 73.575, 40.0, 110.3625, 66.0

    def initial(self, t):
        return 0.0, 0.0, 0.0, 0.0

    def rates(self, t, x1, v1, x2, v2, mode1, mode2):
        pull, link = self.k * (self.v_driver * t - x1), self.link * (x1 - x2)
        a1 = (pull - link - mode1 * self.slide1) / self.m1 if mode1 != 0 else 0.0
        a2 = (link - mode2 * self.slide2) / self.m2 if mode2 != 0 else 0.0
        return a1, a2

    def jacobian(self, t, x1, v1, x2, v2, mode1, mode2):
        one, two = (1.0 / self.m1 if mode1 != 0 else 0.0), (1.0 / self.m2 if mode2 != 0 else 0.0)
        k, link = self.k, self.link
        return k * self.v_driver * one, (-k - link) * one, 0.0, link * one, 0.0, 0.0, link * two, 0.0, -link * two, 0.0

    def hold_mode1(self, t, x1, v1, x2, v2):
        load = self.k * (self.v_driver * t - x1) - self.link * (x1 - x2)
        return load, self.k * self.v_driver + self.link * v2, self.hold1

    def hold_mode2(self, t, x1, v1, x2, v2):
        return self.link * (x1 - x2), self.link * v1, self.hold2

    def terms_mode1(self, t, x1, v1, x2, v2):
        return self.k * (fabs(self.v_driver * t) + fabs(x1)) + self.link * (fabs(x1) + fabs(x2))

    def terms_mode2(self, t, x1, v1, x2, v2):
        return self.link * (fabs(x1) + fabs(x2))
