"""The integration methods there are, and the one in force."""

from . import dop853, ode23, ode45, rodas
from .codes import DOP853, EXACT, ODE23, ODE45, RODAS
from .dop853 import Dop853
from .exact import Exact
from .ode23 import Ode23
from .ode45 import Ode45
from .rodas import Rodas
from .vectors import Contacts, Rates, States

EXACT_ITEM = ("exact", EXACT, "closed form of each linear piece, events included; the hybrid law only")
ITEMS = (
    ("ode23", ODE23, "Bogacki-Shampine 3(2), with the step control of MATLAB's program; for loose tolerances"),
    ("ode45", ODE45, "Dormand-Prince 5(4), with the step control of MATLAB's program; for moderate tolerances"),
    ("dop853", DOP853, "Dormand-Prince 8(5,3); for tight tolerances"),
    ("rodas", RODAS, "Rosenbrock 4(3), L-stable; for stiff friction curves"),
)


class Methods:
    """The method chosen for a run, and how its step size is controlled."""

    def __init__(self):
        self.exact, self.ode23, self.ode45, self.dop853, self.rodas = Exact(), Ode23(), Ode45(), Dop853(), Rodas()
        self.chosen = self.stages = self.extra = 0
        self.power = self.safety = self.shrink = self.grow = 0.0

    def choose(self, method):
        """Put a method in force; between the events of the exact one there are no steps to control."""
        self.chosen = method
        if self.chosen == ODE45:
            self.stages, self.extra = ode45.STAGES, ode45.EXTRA
            self.power, self.safety, self.shrink, self.grow = ode45.POWER, ode45.SAFETY, ode45.SHRINK, ode45.GROW
        elif self.chosen == DOP853:
            self.stages, self.extra = dop853.STAGES, dop853.EXTRA
            self.power, self.safety, self.shrink, self.grow = dop853.POWER, dop853.SAFETY, dop853.SHRINK, dop853.GROW
        elif self.chosen == RODAS:
            self.stages, self.extra = rodas.STAGES, rodas.EXTRA
            self.power, self.safety, self.shrink, self.grow = rodas.POWER, rodas.SAFETY, rodas.SHRINK, rodas.GROW
        else:
            self.stages, self.extra = ode23.STAGES, ode23.EXTRA
            self.power, self.safety, self.shrink, self.grow = ode23.POWER, ode23.SAFETY, ode23.SHRINK, ode23.GROW

    def propose(self, model, modes: Contacts, t, y: States, f: Rates, h) -> tuple[States, Rates, States]:
        """The new state, its rates, and the rates e of the error: the estimates are h e."""
        chosen = self.chosen
        if chosen == ODE23:
            return self.ode23.propose(model, modes, t, y, f, h)
        if chosen == RODAS:
            return self.rodas.propose(model, modes, t, y, f, h)
        if chosen == DOP853:
            return self.dop853.propose(model, modes, t, y, f, h)
        return self.ode45.propose(model, modes, t, y, f, h)

    def expand(self, model, step):
        """The interpolant of the step just taken."""
        if self.chosen == RODAS:
            self.rodas.expand(model, step)
        elif self.chosen == DOP853:
            self.dop853.expand(model, step)
        elif self.chosen == ODE45:
            self.ode45.expand(model, step)
        else:
            self.ode23.expand(model, step)
