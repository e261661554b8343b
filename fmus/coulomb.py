"""Spring and mass with Coulomb friction."""

from math import fabs

from .runtime.automaton import HYBRID_LAW, SIGN_LAW, DryFriction, sign
from .runtime.codes import EXACT, HYBRID
from .runtime.declare import Choice, Fixed, Input, Mode, Output, Parameter
from .runtime.exact import Exact
from .runtime.march import March
from .runtime.methods import EXACT_ITEM, ITEMS


class Solver(March):
    method = Choice(EXACT, "integration method", (EXACT_ITEM, *ITEMS))


class Coulomb(DryFriction):
    """Spring and mass with Coulomb friction, and a viscous damper if wanted.

        m a = F_ext - k x - c v - F_friction
        sliding:   F_friction = f sign(v)
        stuck:     v = 0 while |F_ext - k x| <= f

    L. Meirovitch, Fundamentals of Vibrations, chapter 2.
    """

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(157.9, "N/m", "stiffness of the spring", low=0.0)
    c = Parameter(0.0, "N.s/m", "damping constant", low=0.0)
    f = Parameter(0.5, "N", "friction force", low=0.0)
    x0 = Fixed(0.1, "m", "position at the start")
    v0 = Fixed(0.0, "m/s", "speed at the start")
    friction = Choice(HYBRID, "friction law", (HYBRID_LAW, SIGN_LAW))
    F_ext = Input(0.0, "N", "outer force on the mass")
    x = Output("m", "position of the mass")
    v = Output("m/s", "speed of the mass")
    a = Output("m/s2", "acceleration of the mass", direct=True)
    F_spring = Output("N", "force of the spring on the mass")
    F_friction = Output("N", "force of friction, against the motion", direct=True)
    energy = Output("J", "kinetic and potential energy", low=0.0)
    mode = Mode("-1 sliding backward, 0 stuck, 1 sliding forward")

    linear = True

    def __init__(self):
        super().__init__()
        self.solver = Solver()
        self.exact = Exact()

    def initial(self, t):
        return self.x0, self.v0

    def prepare(self):
        self.exact.prepare(self.m, self.c, self.k, 0.0)
        return super().prepare()

    def rates(self, t, x, v, mode):
        if mode == 0:
            mode = sign(v)
        return (self.F_ext - self.k * x - self.c * v - mode * self.f) / self.m

    def jacobian(self, t, x, v, mode):
        return 0.0, -self.k / self.m, -self.c / self.m

    def push(self, t, mode):
        return (self.F_ext - mode * self.f) / self.m

    def hold(self, t, x, v):
        return self.F_ext - self.k * x, 0.0, self.f

    def terms(self, t, x, v):
        return fabs(self.F_ext) + self.k * fabs(x)

    def observe(self, t, x, v, mode):
        spring = -self.k * x
        pull = self.F_ext + spring
        self.x, self.v, self.F_spring = x, v, spring
        if mode == 0 and self.friction == HYBRID:
            self.mode, self.F_friction, self.a = 0, pull, 0.0
        else:
            if mode == 0:
                mode = sign(v)
            friction = mode * self.f
            self.mode, self.F_friction, self.a = mode, friction, (pull - self.c * v - friction) / self.m
        self.energy = 0.5 * (self.m * v * v - spring * x)
