"""Units of measured motions: order of the derivative, base unit and factor to SI."""

import re
from typing import NamedTuple

from ..errors import SceneError

TIMES = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "nm": 1e-9, "in": 0.0254, "ft": 0.3048}
TURN = 2 * 3.141592653589793
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": TURN / 360, "°": TURN / 360, "rev": TURN, "gon": TURN / 400}
STANDARD_GRAVITY = 9.80665
COUNT_NAMES = ("count", "counts", "cts", "tick", "ticks", "pulse", "pulses", "increments", "inc", "lsb", "digits")
UNIT_SYNONYMS = {
    "seconds": "s", "second": "s", "milliseconds": "ms", "millisecond": "ms", "microseconds": "us", "minutes": "min",
    "hours": "h", "metres": "m", "meters": "m", "metre": "m", "meter": "m", "millimetres": "mm", "millimeters": "mm",
    "centimetres": "cm", "centimeters": "cm", "inches": "in", "inch": "in", "feet": "ft", "radians": "rad",
    "radian": "rad", "degrees": "deg", "degree": "deg", "grad": "deg", "turns": "rev", "turn": "rev",
    "revolutions": "rev", "millis": "ms", "msec": "ms", "micros": "us", "usec": "us", "secs": "s", "sekunden": "s",
    "minuten": "min",
}  # fmt: skip


CHARACTER_SUBSTITUTES = str.maketrans("º˚µμ²³⁻¹·*", "°°uu23-1  ", "^")  # replaced and removed characters


class MotionUnit(NamedTuple):
    """Unit of a motion: `order` of the derivative of a position in `base` (m or rad), and its `size` in SI units."""

    order: int
    base: str
    size: float


def normalize_unit(text: str) -> str:
    """Return a unit in the notation of the tables: µm becomes um; m·s⁻², m s^-2 and m/s/s become m/s2."""
    text = re.sub(r"\s+", " ", text.replace("**", "").translate(CHARACTER_SUBSTITUTES).strip())
    text = re.sub(r"[ .]?s-2$|/s/s$|/\(s2\)$|/sec2$", "/s2", text)
    text = re.sub(r"[ .]s-1$|/sec$", "/s", text)
    return re.sub(r"\s", "", text)


def find_unit(text: str) -> MotionUnit | None:
    """Return a unit of motion by name, or None; in any case, but Nm is a torque and no nanometre."""
    name = normalize_unit(text)
    if name not in UNITS and not name.startswith("N"):
        name = name.lower()
    numerator, slash, denominator = name.partition("/")
    return UNITS.get(UNIT_SYNONYMS.get(numerator, numerator) + slash + denominator)


def time_unit_size(text: str) -> float | None:
    """Return the size in s of a unit of time, also of a multiple as in 0.01s, or None."""
    number, name = re.fullmatch(r"([0-9.]*(?:e-?[0-9]+)?)(.*)", normalize_unit(text).lower(), re.S).groups()  # type: ignore[union-attr]
    size = TIMES.get(UNIT_SYNONYMS.get(name, name))
    try:
        return size and size * float(number or 1)
    except ValueError:
        return None


def parse_per_count(text: str) -> tuple[float, str]:
    """Return size and unit of one count, as in 0.36deg or 1e-3 mm."""
    match = re.fullmatch(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\S.*?)\s*", text)
    if not match or find_unit(match[2]) is None:
        raise SceneError(f"--per-count {text}: give a number and a unit, as in 0.36deg or 0.001mm")
    return float(match[1]), match[2]


def build_unit_table() -> dict[str, MotionUnit]:
    """Return all units and their time derivatives."""
    bases = ((LENGTHS, "m"), (ANGLES, "rad"))
    units = {
        name + rate: MotionUnit(order, base, size)
        for sizes, base in bases
        for name, size in sizes.items()
        for order, rate in enumerate(("", "/s", "/s2"))
    }
    units["rpm"] = MotionUnit(1, "rad", TURN / 60)
    units["g"] = MotionUnit(2, "m", STANDARD_GRAVITY)
    units["mg"] = MotionUnit(2, "m", 1e-3 * STANDARD_GRAVITY)
    return units


UNITS = build_unit_table()
