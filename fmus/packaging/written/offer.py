"""An FMU that offers some of the methods and friction laws, and carries just their code.

What is not offered is settled like what a model fixes, so that its branches, its objects and its files are gone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ...runtime.automaton import HYBRID_LAW, SIGN_LAW, THRESHOLD_LAW
from ...runtime.declare import Declaring, variables
from ...runtime.found import methods
from ...runtime.methods import EXACT_ITEM, ITEMS
from .. import BuildError

METHODS: dict[str, int] = {label: value for label, value, _ in (EXACT_ITEM, *ITEMS)}
LAWS: dict[str, int] = {label: value for label, value, _ in (HYBRID_LAW, SIGN_LAW, THRESHOLD_LAW)}
EXACT, HYBRID = EXACT_ITEM[0], HYBRID_LAW[0]
CHOSEN = {"solver.method": ("method", "chosen"), "friction": ("friction",)}  # variable -> the attributes that tell it


@dataclass(frozen=True)
class Offer:
    """The labels of the methods and of the laws that an FMU shall offer."""

    methods: tuple[str, ...]
    laws: tuple[str, ...]

    @property
    def closed(self) -> bool:
        """Whether it has closed forms."""
        return EXACT in self.methods


def offer(model: type[Declaring], name: str, methods: Sequence[str], laws: Sequence[str]) -> Offer | None:
    """What is asked for, or None for all that the model has; BuildError for what it does not have."""
    chosen = {}
    for variable, word, wanted in ("solver.method", "method", methods), ("friction", "friction law", laws):
        has = items(model, variable)
        for label in wanted:
            if label not in has:
                raise BuildError(f"{name} has no {word} {label!r}; it has {', '.join(has) or 'none to choose'}.")
        chosen[word] = tuple(label for label in has if label in wanted or not wanted)
    kept = chosen["method"]
    if laws and HYBRID not in laws:  # the closed form holds for no other
        kept = tuple(label for label in kept if label != EXACT)
        if not kept:
            raise BuildError(f"{name} has the method {EXACT!r} for the law {HYBRID!r} only: ask for that law as well.")
    return Offer(kept, chosen["friction law"]) if methods or laws else None


def items(model: type[Declaring], variable: str) -> dict[str, int]:
    """Label and value of all that a choice of a model has."""
    declared = dict(variables(model())).get(variable)
    return {label: value for label, value, _ in declared.items} if declared else {}


def choices(model: type[Declaring], offered: Offer | None) -> dict[str, tuple[int, ...]]:
    """Every attribute that tells a choice, with the values that it can have."""
    found: dict[str, tuple[int, ...]] = {}
    for variable, attributes in CHOSEN.items():
        kept = items(model, variable)
        if offered:
            kept = {label: value for label, value in kept.items() if label in offered.methods + offered.laws}
        found |= dict.fromkeys(attributes, tuple(kept.values())) if kept else {}
    return found


def gone(offered: Offer | None) -> frozenset[str]:
    """The labels of what is not offered."""
    return frozenset({*METHODS, *LAWS} - {*offered.methods, *offered.laws}) if offered else frozenset()


def stepping(offered: Offer | None) -> dict[str, str]:
    """Label and class of the methods with steps that are offered."""
    return {label: cls.__name__ for label, _, cls in methods if offered is None or label in offered.methods}
