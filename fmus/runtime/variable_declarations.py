"""Declared variables: the number, its unit, its range and its sentence in one place.

A variable is an attribute of a class; it takes its name from there.  An instance of the class starts with
plain numbers of the same names.  The XML, the pages and the error messages read the declaration.
"""

from __future__ import annotations

from math import inf, isfinite
from typing import Any

from .call_sequence import is_in_range


class VariableDeclaration:
    """What a variable is: unit, description and range; an enumeration has `items` (label, value, sentence)."""

    type = "Real"
    causality = ""
    variability = ""
    initial = ""
    start: float = 0.0
    items: tuple[tuple[str, int, str], ...] = ()
    role = ""  # what it is to the motion: a "state", the force of a "contact"
    rate_of = ""  # the name of the state whose rate it is
    rate = ""  # the name of the parameter that is its rate for all time, as of a driver

    def __init__(
        self,
        unit: str,
        text: str,
        low: float = -inf,
        high: float = inf,
        above: float = -inf,
        below: float = inf,
        display: str = "",
        alias: str = "",
    ) -> None:
        self.name = ""
        self.unit, self.text, self.display, self.alias = unit, text, display, alias
        self.low, self.high, self.above, self.below = low, high, above, below

    def __set_name__(self, owner: object, name: str) -> None:
        self.name = name

    @property
    def unit_suffix(self) -> str:
        """The unit, as it stands behind a number."""
        return "" if self.unit in ("", "1") else f" {self.unit}"

    @property
    def allowed(self) -> str:
        """The range in words."""
        if self.items:
            return "one of " + ", ".join(f"{value} ({label})" for label, value, _ in self.items)
        coefficient_bounds = (
            ("at least", self.low),
            ("above", self.above),
            ("at most", self.high),
            ("below", self.below),
        )
        words = [f"{word} {bound!r}{self.unit_suffix}" for word, bound in coefficient_bounds if isfinite(bound)]
        return " and ".join(words) or "a finite number"

    def accepts(self, value: float) -> bool:
        """Whether `value` lies in the range; NaN and infinities never do."""
        if self.items:
            return value in [number for _, number, _ in self.items]
        return is_in_range(value, self.low, self.high, self.above, self.below)


class Parameter(VariableDeclaration):
    """Set by the user; tunable at every communication point."""

    causality, variability, initial = "parameter", "tunable", "exact"

    def __init__(self, start: float, unit: str, text: str, **more: Any) -> None:
        super().__init__(unit, text, **more)
        self.start = start


class Fixed(Parameter):
    """Set by the user before initialisation ends."""

    variability = "fixed"


class Choice(Fixed):
    """An enumeration, set before initialisation ends: items of (label, value, sentence)."""

    type = "Enumeration"

    def __init__(self, start: int, text: str, items: tuple[tuple[str, int, str], ...]) -> None:
        super().__init__(start, "", text)
        self.items = items


class Input(Parameter):
    """Set by the importer, held over a communication step."""

    causality, variability, initial = "input", "continuous", ""


class Output(VariableDeclaration):
    """Calculated; `direct`: it follows a changed input at once, without a step in between."""

    causality, variability, initial = "output", "continuous", "calculated"

    def __init__(self, unit: str, text: str, direct: bool = False, rate_of: str = "", **more: Any) -> None:
        super().__init__(unit, text, **more)
        self.direct, self.rate_of = direct, rate_of


class State(Output):
    """A continuous state."""

    role = "state"

    def __init__(self, unit: str, text: str, rate: str = "", **more: Any) -> None:
        super().__init__(unit, text, **more)
        self.rate = rate


class Contact(Output):
    """The force of dry friction in a contact."""

    role = "contact"

    def __init__(self, unit: str, text: str, **more: Any) -> None:
        super().__init__(unit, text, direct=True, **more)


class Mode(Output):
    """The discrete state of dry friction: -1, 0 or 1."""

    type, variability, start = "Integer", "discrete", 0

    def __init__(self, text: str) -> None:
        super().__init__("", text, direct=True, low=-1, high=1)


class Local(VariableDeclaration):
    """Calculated; read on request, not recorded by default."""

    causality, variability, initial = "local", "discrete", "calculated"


class Count(Local):
    """A number of things that have happened."""

    type, start = "Integer", 0

    def __init__(self, text: str) -> None:
        super().__init__("", text, low=0)


class VariableOwner:
    """An instance starts with the start value of every declared variable, as plain attributes."""

    def __init__(self) -> None:
        for declared in declarations(type(self)):
            setattr(self, declared.name, declared.start)


def declarations(cls: type) -> list[VariableDeclaration]:
    """The declared variables of a class, its own before those of its bases; a class may declare one anew."""
    found: dict[str, VariableDeclaration] = {}
    for base in cls.__mro__:
        for name, value in vars(base).items():
            if isinstance(value, VariableDeclaration):
                found.setdefault(name, value)
    return list(found.values())


def variables(thing: VariableOwner, prefix: str = "") -> list[tuple[str, VariableDeclaration]]:
    """Dotted name and declaration of every variable of an object and of the objects it owns, in order."""
    found = [(prefix + declared.name, declared) for declared in declarations(type(thing))]
    for name, part in vars(thing).items():
        if isinstance(part, VariableOwner):
            found += variables(part, f"{prefix}{name}.")
    return found
