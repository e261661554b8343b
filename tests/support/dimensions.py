"""Numbers with a physical dimension, to check that equations are consistent with their units.

The code of models and methods computes with them like with floats; adding a force to a length raises DimensionError.
"""

import math
import operator
import sys
from fractions import Fraction

from fmus.compiler.units import unit_of

BASES = ("kg", "m", "s", "A", "K")
ANY = (0.0, math.inf)  # zero and infinity match every dimension


class DimensionError(AssertionError):
    """Quantities of different dimensions were added or compared, or a function got an argument with a dimension."""


class Quantity:
    """A value in SI units with the exponents of the base units; angles are dimensionless."""

    def __init__(self, value, *powers):
        self.value, self.powers = value, (*powers, *(0,) * (len(BASES) - len(powers)))

    @classmethod
    def of(cls, value, symbol):
        """Return a value in a declared unit."""
        unit = unit_of(symbol, symbol)
        return cls(value, *(getattr(unit, base) for base in BASES))

    def __repr__(self):
        return f"{self.value!r} " + " ".join(f"{base}^{power}" for base, power in zip(BASES, self.powers, strict=True))

    def __float__(self):
        if any(self.powers):
            raise DimensionError(f"a function of numbers was given {self!r}")
        return self.value

    def like(self, other, operation):
        """Return the value of `other`, which must have the same dimension."""
        if not isinstance(other, Quantity):
            if abs(other) not in ANY and any(self.powers):
                raise DimensionError(f"{operation.__name__} of {self!r} and the number {other!r}")
            return other
        if self.powers != other.powers:
            raise DimensionError(f"{operation.__name__} of {self!r} and {other!r}")
        return other.value


def _same(operation, swapped=False, answer=lambda value, powers: Quantity(value, *powers)):
    def method(self, other):
        pair = (self.value, self.like(other, operation))
        return answer(operation(*(reversed(pair) if swapped else pair)), self.powers)

    return method


def _product(operation, sign):
    def method(self, other):
        if not isinstance(other, Quantity) and other == 0.0:
            return 0.0
        value, powers = (other.value, other.powers) if isinstance(other, Quantity) else (other, (0,) * len(BASES))
        return Quantity(operation(self.value, value), *(p + sign * q for p, q in zip(self.powers, powers, strict=True)))

    return method


Quantity.__add__ = Quantity.__radd__ = _same(operator.add)
Quantity.__sub__, Quantity.__rsub__ = _same(operator.sub), _same(operator.sub, swapped=True)
Quantity.__mul__ = Quantity.__rmul__ = _product(operator.mul, 1)
Quantity.__truediv__ = _product(operator.truediv, -1)
Quantity.__rtruediv__ = lambda self, other: other and Quantity(other / self.value, *(-power for power in self.powers))
Quantity.__neg__ = lambda self: Quantity(-self.value, *self.powers)
for _name in ("lt", "le", "gt", "ge", "eq"):
    setattr(Quantity, f"__{_name}__", _same(getattr(operator, _name), answer=lambda value, powers: value))


def _sqrt(x):
    if not isinstance(x, Quantity):
        return math.sqrt(x)
    return Quantity(math.sqrt(x.value), *(Fraction(power) / 2 for power in x.powers))


def _fabs(x):
    return Quantity(abs(x.value), *x.powers) if isinstance(x, Quantity) else math.fabs(x)


def _copysign(x, y):
    sign = y.value if isinstance(y, Quantity) else y
    return Quantity(math.copysign(x.value, sign), *x.powers) if isinstance(x, Quantity) else math.copysign(x, sign)


def _atan2(y, x):
    return (
        math.atan2(y.value, y.like(x, math.atan2))
        if isinstance(y, Quantity) and isinstance(x, Quantity)
        else math.atan2(y, x)
    )


FUNCTIONS = {"sqrt": _sqrt, "fabs": _fabs, "copysign": _copysign, "atan2": _atan2}


def patch_functions(monkeypatch):
    """Make the emitted models and their runtime use math functions that accept quantities."""
    for name, module in list(sys.modules.items()):
        if name.startswith("lowered_"):
            for function, taught in FUNCTIONS.items():
                if getattr(module, function, None) is getattr(math, function):
                    monkeypatch.setattr(module, function, taught)
