"""The units that models may declare, by their SI base units (FMI 2.0.4, section 2.2.2).

1 <unit> = kg^kg · m^m · s^s · rad^rad;   value in display unit = factor · value in unit.
"""

from dataclasses import dataclass
from math import pi

from . import BuildError

DEGREE = 180.0 / pi


@dataclass(frozen=True)
class Unit:
    """What is measured, the exponents of the base units, and the unit that people prefer to read, if another."""

    quantity: str
    kg: int = 0
    m: int = 0
    s: int = 0
    rad: int = 0
    display: str = ""
    factor: float = 1.0


UNITS = {
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


def unit_of(name: str, symbol: str, display: str = "") -> Unit:
    """The unit of the variable `name`, with the display unit that it asks for."""
    if symbol not in UNITS:
        raise BuildError(f"{name} has the unit {symbol!r}; known units are {', '.join(UNITS)}: add it to units.py.")
    unit = UNITS[symbol]
    if display not in ("", symbol, unit.display):
        allowed = " or ".join(repr(word) for word in (symbol, unit.display) if word)
        raise BuildError(f"{name} has the display unit {display!r}; allowed for {symbol} is {allowed}.")
    return unit
