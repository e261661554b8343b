"""Units that models may declare: products and quotients of SI units, such as N.m.s/rad (FMI 2.0.4, section 2.2.2).

1 <unit> = kg^kg · m^m · s^s · A^A · K^K · rad^rad;   value in display unit = factor · value in unit.

There is no display unit for temperatures: degC has an offset, which would be wrong for differences.
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
    A: int = 0
    K: int = 0
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
    "K": Unit("Temperature", K=1),
    "A": Unit("ElectricCurrent", A=1),
    "V": Unit("Voltage", kg=1, m=2, s=-3, A=-1),
}


BASE_UNITS = ("kg", "m", "s", "A", "K", "rad")
SYMBOLS: dict[str, dict[str, int]] = {  # exponents of the base units
    "1": {},
    **{name: {name: 1} for name in ("kg", "m", "s", "rad")},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
    "K": {"K": 1},
    "A": {"A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "C": {"s": 1, "A": 1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
}
DENOMINATOR_PATTERN = re.compile(r"/\(([^()/]+)\)")  # W/(m2.K)
FACTOR_PATTERN = re.compile(r"([./])(1|[A-Za-z]+)(-?\d{1,2})?")


def parse_unit(symbol: str) -> Unit | None:
    """Parse a product or quotient of units with optional exponents; return None if invalid.

    >>> parse_unit("N.m.s/rad")
    Unit(quantity='N.m.s/rad', kg=1, m=2, s=-1, A=0, K=0, rad=-1, display='', factor=1.0)
    >>> parse_unit("W/(m2.K)") == Unit("W/(m2.K)", kg=1, s=-3, K=-1)
    True
    """
    product = "." + DENOMINATOR_PATTERN.sub(lambda match: "/" + match[1].replace(".", "/"), symbol)
    factors = FACTOR_PATTERN.findall(product)
    if "".join(map("".join, factors)) != product or any(part not in SYMBOLS for _, part, _ in factors):
        return None
    exponents = dict.fromkeys(BASE_UNITS, 0)
    for sign, part, power in factors:
        for base, exponent in SYMBOLS[part].items():
            exponents[base] += exponent * int(power or "1") * (1 if sign == "." else -1)
    kg, m, s, A, K, rad = exponents.values()
    return Unit(symbol, kg, m, s, A, K, rad)


def unit_of(name: str, symbol: str, display: str = "") -> Unit:
    """Return the unit of the variable `name`; raise BuildError for an unknown unit or display unit."""
    unit = UNITS.get(symbol) or parse_unit(symbol)
    if unit is None:
        raise BuildError(
            f"{name} has the unit {symbol!r}; allowed units are {', '.join(UNITS)}, and products of powers of "
            f"{', '.join(SYMBOLS)}, such as N.m.s/rad or W/(m2.K)."
        )
    if display not in ("", symbol, unit.display):
        choices = " or ".join(repr(word) for word in (symbol, unit.display) if word)
        raise BuildError(f"{name} has the display unit {display!r}; allowed for {symbol}: {choices}.")
    return unit
