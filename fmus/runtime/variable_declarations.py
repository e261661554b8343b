"""Declarations of variables: start value, unit, range and description.

A declaration is a class attribute, whose name is the name of the variable.  Instances of the class start with plain
numbers under the same names.  XML, documentation pages and error messages use the declarations.  A value of a table has
an attribute that is an identifier, as mu_y1, and another name in the FMU, as mu.y[1].  Model files declare variables by
the classes of compiler/equations/model_declaration.py, for each of which the generated class has a VariableDeclaration.
"""

from __future__ import annotations

from copy import copy
from math import inf, isfinite
from typing import Any


def is_in_range(value: float, low: float, high: float, above: float, below: float) -> bool:
    """Return whether a value is in a range; NaN and infinities never are."""
    return isfinite(value) and low <= value <= high and above < value < below


class VariableDeclaration:
    """Declaration of a variable: unit, description, range; enumerations have `items` (label, value, description).

    Inputs are constant over a communication step unless they have rates.
    """

    type = "Real"
    is_integer = False  # its value is stored as an integer, also if its type is Real
    causality = "output"
    variability = "continuous"
    direct = False  # an output that depends on an input directly, without a step in between
    start: float = 0.0
    items: tuple[tuple[str, int, str], ...] = ()
    role = ""  # "state", or "contact" for the friction force of a contact
    rate_of = ""  # name of the state whose rate this is
    rate = ""  # name of the parameter that is its constant rate, as for a driver
    element = ""  # name in the FMU of an element of an array, as mu.y[1]; others have that of the attribute
    # options, see compiler/equations/model_declaration.py
    low: float = -inf
    high: float = inf
    above: float = -inf
    below: float = inf
    display = ""

    def __init__(self, unit: str, text: str, **options: Any) -> None:
        self.name = ""
        self.unit, self.text = unit, text
        vars(self).update(options)

    def __set_name__(self, owner: object, name: str) -> None:
        self.name = name

    @property
    def initial(self) -> str:
        """Return how the start value is defined; empty where FMI has no choice."""
        return {"parameter": "exact", "output": "calculated", "local": "calculated"}.get(self.causality, "")

    @property
    def unit_suffix(self) -> str:
        """Return the unit as a suffix of a number."""
        return "" if self.unit in ("", "1") else f" {self.unit}"

    @property
    def allowed_range(self) -> str:
        """Return the range in words."""
        if self.items:
            return "one of " + ", ".join(f"{value} ({label})" for label, value, _ in self.items)
        bounds = ("at least", self.low), ("above", self.above), ("at most", self.high), ("below", self.below)
        words = [f"{word} {bound!r}{self.unit_suffix}" for word, bound in bounds if isfinite(bound)]
        return " and ".join(words) or "a finite number"

    def accepts(self, value: float) -> bool:
        """Return whether `value` is in the range; NaN and infinities never are."""
        if self.items:
            return value in [number for _, number, _ in self.items]
        return is_in_range(value, self.low, self.high, self.above, self.below)


class Setting(VariableDeclaration):
    """Parameter that is fixed after initialisation."""

    causality, variability = "parameter", "fixed"

    def __init__(self, start: float, unit: str, text: str, **options: Any) -> None:
        super().__init__(unit, text, **options)
        self.start = start


class Enumeration(Setting):
    """Enumeration that is fixed after initialisation; items are (label, value, description)."""

    type, is_integer = "Enumeration", True

    def __init__(self, start: int, text: str, items: tuple[tuple[str, int, str], ...]) -> None:
        super().__init__(start, "", text)
        self.items = items


class Local(VariableDeclaration):
    """Local variable, calculated, not recorded by default."""

    causality, variability = "local", "discrete"


class Count(Local):
    """Counter."""

    type, is_integer, start = "Integer", True, 0

    def __init__(self, text: str) -> None:
        super().__init__("", text, low=0)


class VariableOwner:
    """Object whose declared variables are plain attributes, initialized with their start values."""

    def __init__(self) -> None:
        for declaration in declarations(type(self)):
            setattr(self, declaration.name, declaration.start)


def declarations(cls: type) -> list[VariableDeclaration]:
    """Return the declarations of a class, its own before those of its bases; a class may override one."""
    result: dict[str, VariableDeclaration] = {}
    for base in cls.__mro__:
        for name, value in vars(base).items():
            if isinstance(value, VariableDeclaration):
                result.setdefault(name, value)
    return list(result.values())


def exported_name(path: str, declaration: VariableDeclaration) -> str:
    """Return the name in the FMU of the variable at a dotted path."""
    return declaration.element or path


def fmi_variables(model: Any, run: object) -> list[tuple[str, VariableDeclaration]]:
    """Return dotted path and declaration of every variable that an FMU offers: of the model, then of its run.

    An enumeration with one item, as the build leaves it, is no choice: it is left out and keeps its start value.  An
    FMU with Reals only has no other enumerations, and offers integers as Reals.
    """
    pairs = [(name, meaning) for name, meaning in variables(model) + variables(run) if len(meaning.items) != 1]
    if model.real_only:
        pairs = [(name, as_real(meaning)) for name, meaning in pairs if not meaning.items]
    return pairs


def as_real(declaration: VariableDeclaration) -> VariableDeclaration:
    """Return a declaration with an integer as a dimensionless Real."""
    real = copy(declaration)
    if real.type == "Integer":
        real.type, real.unit = "Real", "1"
    return real


def variables(owner: object, prefix: str = "") -> list[tuple[str, VariableDeclaration]]:
    """Return dotted path and declaration of every variable of an object and of the objects it owns, in order."""
    result = [(prefix + declaration.name, declaration) for declaration in declarations(type(owner))]
    for name, part in vars(owner).items():
        if isinstance(part, VariableOwner):
            result += variables(part, f"{prefix}{name}.")
    return result
