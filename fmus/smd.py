"""Spring, mass and viscous damper."""

from .runtime.codes import EXACT
from .runtime.declare import Choice, Fixed, Input, Output, Parameter
from .runtime.exact import Exact
from .runtime.march import March
from .runtime.methods import EXACT_ITEM, ITEMS
from .runtime.oscillator import Oscillator


class Solver(March):
    method = Choice(EXACT, "integration method", (EXACT_ITEM, *ITEMS))


class Smd(Oscillator):
    """Spring, mass and viscous damper: the damped linear oscillator.

        m a = F_ext - k x - c v

    L. Meirovitch, Fundamentals of Vibrations, chapter 2.
    """

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(157.9, "N/m", "stiffness of the spring", low=0.0)
    c = Parameter(2.0, "N.s/m", "damping constant", low=0.0)
    x0 = Fixed(0.1, "m", "position at the start")
    v0 = Fixed(0.0, "m/s", "speed at the start")
    F_ext = Input(0.0, "N", "outer force on the mass")
    x = Output("m", "position of the mass")
    v = Output("m/s", "speed of the mass")
    a = Output("m/s2", "acceleration of the mass", direct=True)
    F_spring = Output("N", "force of the spring on the mass")
    F_damper = Output("N", "force of the damper on the mass")
    energy = Output("J", "kinetic and potential energy", low=0.0)

    linear = True

    def __init__(self):
        super().__init__()
        self.solver = Solver()
        self.exact = Exact()

    def initial(self, t):
        return self.x0, self.v0

    def prepare(self):
        self.exact.prepare(self.m, self.c, self.k, 0.0)
        return 0

    def rates(self, t, x, v, mode):
        return (self.F_ext - self.k * x - self.c * v) / self.m

    def jacobian(self, t, x, v, mode):
        return 0.0, -self.k / self.m, -self.c / self.m

    def push(self, t, mode):
        return self.F_ext / self.m

    def observe(self, t, x, v, mode):
        spring, damper = -self.k * x, -self.c * v
        self.x, self.v = x, v
        self.F_spring, self.F_damper = spring, damper
        self.a = (self.F_ext + spring + damper) / self.m
        self.energy = 0.5 * (self.m * v * v - spring * x)
