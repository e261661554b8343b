"""Units that models may declare: products and quotients of SI units, such as N.m.s/rad (FMI 2.0.4, section 2.2.2).

1 <unit> = kg^kg · m^m · s^s · rad^rad;   value in display unit = factor · value in unit.
"""

import re
from dataclasses import dataclass
from math import pi

from . import BuildError

DEGREE = 180.0 / pi


@dataclass(frozen=True)
class Unit:
    """Physical quantity, exponents of the base units, and optional display unit with its conversion factor."""

    quantity: str
    kg: int = 0
    m: int = 0
    s: int = 0
    rad: int = 0
    display: str = ""
    factor: float = 1.0


UNITS = {  # units whose quantity has a name
    "1": Unit("Ratio"),
    "s": Unit("Time", s=1),
    "kg": Unit("Mass", kg=1),
    "m": Unit("Length", m=1),
    "m/s": Unit("Velocity", m=1, s=-1),
    "m/s2": Unit("Acceleration", m=1, s=-2),
    "N": Unit("Force", kg=1, m=1, s=-2),
    "N/m": Unit("TranslationalSpringConstant", kg=1, s=-2),
    "N.s/m": Unit("TranslationalDampingConstant", kg=1, s=-1),
    "J": Unit("Energy", kg=1, m=2, s=-2),
    "rad": Unit("Angle", rad=1, display="deg", factor=DEGREE),
    "rad/s": Unit("AngularVelocity", s=-1, rad=1, display="deg/s", factor=DEGREE),
    "rad/s2": Unit("AngularAcceleration", s=-2, rad=1, display="deg/s2", factor=DEGREE),
    "kg.m2": Unit("MomentOfInertia", kg=1, m=2),
    "N.m": Unit("Torque", kg=1, m=2, s=-2),
}


SYMBOLS = {  # exponents of kg, m, s and rad
    **{"1": (0, 0, 0, 0), "kg": (1, 0, 0, 0), "m": (0, 1, 0, 0), "s": (0, 0, 1, 0), "rad": (0, 0, 0, 1)},
    **{"N": (1, 1, -2, 0), "J": (1, 2, -2, 0), "W": (1, 2, -3, 0), "Pa": (1, -1, -2, 0), "Hz": (0, 0, -1, 0)},
}
FACTOR_PATTERN = re.compile(r"([./])(1|[A-Za-z]+)(-?\d{1,2})?")


def parse_unit(symbol: str) -> Unit | None:
    """Parse a product or quotient of units with optional exponents; return None if invalid.

    >>> parse_unit("N.m.s/rad")
    Unit(quantity='N.m.s/rad', kg=1, m=2, s=-1, rad=-1, display='', factor=1.0)
    """
    factors = FACTOR_PATTERN.findall(f".{symbol}")
    if "".join(map("".join, factors)) != f".{symbol}" or any(part not in SYMBOLS for _, part, _ in factors):
        return None
    times = [int(power or "1") * (1 if sign == "." else -1) for sign, _, power in factors]
    exponents = [[n * power for power in SYMBOLS[part]] for n, (_, part, _) in zip(times, factors, strict=True)]
    kg, m, s, rad = map(sum, zip(*exponents, strict=True))
    return Unit(symbol, kg, m, s, rad)


def unit_of(name: str, symbol: str, display: str = "") -> Unit:
    """Return the unit of the variable `name`; raise BuildError for an unknown unit or display unit."""
    unit = UNITS.get(symbol) or parse_unit(symbol)
    if unit is None:
        raise BuildError(
            f"{name} has the unit {symbol!r}; allowed units are {', '.join(UNITS)}, and products of powers of "
            f"{', '.join(SYMBOLS)}, such as N.m.s/rad."
        )
    if display not in ("", symbol, unit.display):
        allowed = " or ".join(repr(word) for word in (symbol, unit.display) if word)
        raise BuildError(f"{name} has the display unit {display!r}; allowed for {symbol}: {allowed}.")
    return unit
