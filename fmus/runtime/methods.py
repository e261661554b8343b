"""The integration methods there are, and the one in force."""

from .codes import EXACT
from .exact import Exact
from .found import methods
from .vectors import Contacts, Rates, States

EXACT_ITEM = ("exact", EXACT, "closed form of each linear piece, events included; the hybrid law only")
ITEMS = tuple((label, file.NUMBER, file.TEXT) for label, file, _ in methods)


class Methods:
    """The method chosen for a run, and how its step size is controlled."""

    def __init__(self):
        self.exact = Exact()
        for label, _, Method in methods:
            setattr(self, label, Method())
        self.chosen = self.stages = self.extra = 0
        self.power = self.safety = self.shrink = self.grow = 0.0

    def choose(self, method):
        """Put a method in force; between the events of the exact one there are no steps to control."""
        self.chosen = method
        for _, file, _ in methods:
            if method == file.NUMBER:
                self.stages, self.extra = file.STAGES, file.EXTRA
                self.power, self.safety, self.shrink, self.grow = file.POWER, file.SAFETY, file.SHRINK, file.GROW

    def propose(self, model, modes: Contacts, t, y: States, f: Rates, h) -> tuple[States, Rates, States]:
        """The new state, its rates, and the rates e of the error: the estimates are h e."""
        chosen = self.chosen
        for label, file, _ in methods:
            if chosen == file.NUMBER:
                return getattr(self, label).propose(model, modes, t, y, f, h)

    def expand(self, model, step):
        """The interpolant of the step just taken."""
        for label, file, _ in methods:
            if self.chosen == file.NUMBER:
                getattr(self, label).expand(model, step)
