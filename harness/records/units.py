"""Headings of records: the names and units in them, SI units, and factors between units."""

import re
from collections import Counter
from functools import cache
from typing import NamedTuple

TIME_NAME = re.compile(
    r"^(t|times?|zeit|temps|tiempo|tid|timestamp|datetime|date|elapsed|seconds|epoch)(?![^\W_])|(time|zeit|stamp)$",
    re.I,
)
DATE_NAME = re.compile(r"^(date|datum)\b", re.I)
QUANTITY_NAMES = (
    re.compile(
        r"^(x|y|z|s|theta|phi|pos|position|displacement|disp|angle|weg|winkel|laser|encoder|height|distance)\b", re.I
    ),
    re.compile(r"^(v|vel|velocity|speed|omega|gyro|gyroscope|rate)\b|velocity|gyroscope|speed", re.I),
    re.compile(r"^(a|acc|accel|accelerometer|alpha|a[xyz])\b|acceleration|accelerometer|accel|^a_|^acc", re.I),
)
FORCE_NAME = re.compile(r"^(f|force|kraft|friction|reibung\w*|load|t|m|tau|torque|moment|drehmoment)(?![^\W_])", re.I)
MAGNITUDE_NAME = re.compile(r"\b(abs|absolute|magnitude|norm)\b", re.I)  # of a vector; has no sign
BRACKETED_UNIT = re.compile(r"[^\[\]()]*(\([^()]*\))?")  # with at most one group, as in m/(s^2)
BRACKETS = re.compile(r"[\[(]([^\[\]()]+)[\])]")
WORD_BOUNDARY = re.compile(r"[ _,:]+|(?<=[a-z])(?=[A-Z])")
MAX_UNIT_WORDS = 3  # as in acc_m_s_s


def split_heading(heading: str) -> tuple[str, str | None]:
    """Return name and unit of a heading: x [mm], x / mm, x_mm, millis."""
    name = heading.strip()
    start = find_last_bracket(name)
    if start is not None:
        return name[:start].rstrip(), name[start + 1 : -1].strip() or None
    parts = name.rsplit(None, 2)  # x / mm, x in mm
    if len(parts) == 3 and parts[1] in ("/", "in") and (is_unit(parts[2]) or unit_size(parts[2])):
        return parts[0], parts[2]
    bracket_match = BRACKETS.search(name)  # followed by a run, as in x (mm) Run #1
    if bracket_match and is_unit(bracket_match[1]):
        outer_parts = name[: bracket_match.start()].rstrip(), name[bracket_match.end() :].lstrip()
        return " ".join(filter(None, outer_parts)), bracket_match[1].strip()
    words = WORD_BOUNDARY.split(name)
    for i in range(max(len(words) - MAX_UNIT_WORDS, 1), len(words)):
        stem, suffix = " ".join(words[:i]).strip(), "/".join(words[i:]).strip()
        if (
            time_unit_size(suffix)
            if TIME_NAME.search(stem)
            else len(suffix) > 1 and suffix.lower() != "in" and find_unit(suffix)
        ):
            return stem, suffix
    if len(name) > 1 and name.lower() not in ("in", "min") and is_unit(name):
        return name, name
    return name, None


def find_last_bracket(text: str) -> int | None:
    """Return the index of the bracket that opens the unit at the end of a text, or None if it ends with none."""
    if not text.endswith((")", "]")):
        return None
    depth = 0
    for i in range(len(text) - 1, -1, -1):
        depth += (text[i] in ")]") - (text[i] in "([")
        if depth == 0:
            return i if BRACKETED_UNIT.fullmatch(text, i + 1, len(text) - 1) else None
    return None


def is_unit(text: str) -> bool:
    """Return whether a text is a unit of a motion or of time."""
    return find_unit(text) is not None or time_unit_size(text) is not None


def order_from_name(name: str) -> int | None:
    """Return the order of the derivative that a name indicates, or None."""
    return next((order for order in (2, 1, 0) if QUANTITY_NAMES[order].search(name)), None)


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
POUND = 0.45359237  # kg
Powers = dict[str, int]  # powers of the base units kg, m, s, A and K, and of cycles
PREFIXES = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9, "m": 1e-3, "u": 1e-6, "n": 1e-9, "c": 1e-2, "d": 1e-1}
NAMED_UNITS: dict[str, tuple[float, Powers]] = {
    **{name: (size, {"m": 1}) for name, size in LENGTHS.items()},
    **{name: (size, {"s": 1}) for name, size in TIMES.items()},
    **{name: (size, {}) for name, size in ANGLES.items()},
    "kg": (1.0, {"kg": 1}),
    "lb": (POUND, {"kg": 1}),
    "lbf": (POUND * STANDARD_GRAVITY, {"kg": 1, "m": 1, "s": -2}),
    "kgf": (STANDARD_GRAVITY, {"kg": 1, "m": 1, "s": -2}),
    "Hz": (1.0, {"cycle": 1, "s": -1}),
    "%": (0.01, {}),
}
PREFIXED_UNITS: dict[str, tuple[float, Powers]] = {
    "g": (1e-3, {"kg": 1}),
    "m": (1.0, {"m": 1}),
    "s": (1.0, {"s": 1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "Pa": (1.0, {"kg": 1, "m": -1, "s": -2}),
    "J": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "V": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "A": (1.0, {"A": 1}),
    "C": (1.0, {"s": 1, "A": 1}),
    "ohm": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
    "H": (1.0, {"kg": 1, "m": 2, "s": -2, "A": -2}),
    "K": (1.0, {"K": 1}),
}
FACTOR = re.compile(r"([^\W\d_]+|°|%)(-?\d+)?|1")
TORQUES = {"Nm": "N.m", "Nmm": "N.mm", "kNm": "kN.m"}
SYNONYMS = UNIT_SYNONYMS | {"°": "deg", "sec": "s"}


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
    """Return a unit of motion by name, or None. Upper and lower case are equal, except that Nm is a torque."""
    name = normalize_unit(text)
    if name not in UNITS and not name.startswith("N"):
        name = name.lower()
    numerator, slash, denominator = name.partition("/")
    return UNITS.get(UNIT_SYNONYMS.get(numerator, numerator) + slash + denominator)


def time_unit_size(text: str) -> float | None:
    """Return the size in s of a unit of time or of a multiple of it, as 0.01s; None for other texts."""
    number, name = re.fullmatch(r"([0-9.]*(?:e-?[0-9]+)?)(.*)", normalize_unit(text).lower(), re.S).groups()  # type: ignore[union-attr]
    size = TIMES.get(UNIT_SYNONYMS.get(name, name))
    try:
        return size and size * float(number or 1)
    except ValueError:
        return None


def split_count(text: str) -> tuple[float, str]:
    """Return size and unit of one count, as in 0.36deg or 1e-3 mm; any other unit has the size 1."""
    match = re.fullmatch(r"\s*([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(\S.*?)\s*", text)
    return (float(match[1]), match[2]) if match and find_unit(match[2]) else (1.0, text)


def build_unit_table() -> dict[str, MotionUnit]:
    """Return all units and their time derivatives."""
    bases = ((LENGTHS, "m"), (ANGLES, "rad"))
    units = {
        name + rate: MotionUnit(order, base, size)
        for sizes, base in bases
        for name, size in sizes.items()
        for order, rate in enumerate(("", "/s", "/s2"))
    }
    for name in ("rpm", "rev/min", "r/min", "u/min", "1/min"):
        units[name] = MotionUnit(1, "rad", TURN / 60)
    units["g"] = MotionUnit(2, "m", STANDARD_GRAVITY)
    units["mg"] = MotionUnit(2, "m", 1e-3 * STANDARD_GRAVITY)
    return units


UNITS = build_unit_table()


def unit_factors(text: str) -> Powers | None:
    """Return the powers of the factors of a unit by name, as {"m": 1, "s": -2} for m/s2, m.s-2 and m s^-2.

    The names need not be known. Returns None if the text is not a unit.
    """
    text = text.replace("**", "").translate(CHARACTER_SUBSTITUTES)
    text = re.sub(r"\b(Nm|Nmm|kNm)\b", lambda match: TORQUES[match[0]], text)
    powers = Counter[str]()
    for i, part in enumerate(text.split("/")):
        for factor in filter(None, re.split(r"[.\s()]+", part)):
            match = FACTOR.fullmatch(factor)
            if not match:
                return None
            if match[1]:
                powers[SYNONYMS.get(match[1].lower(), match[1])] += (-1 if i else 1) * int(match[2] or 1)
    return {name: power for name, power in powers.items() if power}


def unit_size(text: str) -> tuple[float, Powers] | None:
    """Return a unit as a multiple of powers of base units, or None if it is not known."""
    motion = find_unit(text) if text.strip() not in TORQUES else None
    if motion is not None:
        powers = {"m": int(motion.base == "m"), "s": -motion.order}
        return motion.size, {base: power for base, power in powers.items() if power}
    factors = unit_factors(text)
    if factors is None:
        return None
    size, totals = 1.0, Counter[str]()
    for name, power in factors.items():
        factor_size = named_unit(name)
        if not factor_size:
            return None
        size *= factor_size[0] ** power
        for base, exponent in factor_size[1].items():
            totals[base] += power * exponent
    return size, {base: power for base, power in totals.items() if power}


def force_unit_size(unit: str, base: str) -> float | None:
    """Return the size of a unit of force (N) or torque (N.m); None if it is none. N.m is no unit of energy here."""
    size = unit_size(unit)
    return size[0] if size and size[1] == unit_size(base)[1] else None  # type: ignore[index]


def is_force_unit(unit: str) -> bool:
    """Return whether a unit is one of force or torque."""
    return any(force_unit_size(unit, base) is not None for base in ("N", "N.m"))


def named_unit(name: str) -> tuple[float, Powers] | None:
    """Return a unit of one word, with a prefix or without."""
    if name in NAMED_UNITS:
        return NAMED_UNITS[name]
    for prefix, factor in PREFIXES.items():
        unit = PREFIXED_UNITS.get(name.removeprefix(prefix)) if name.startswith(prefix) else None
        if unit:
            return factor * unit[0], unit[1]
    return None


def conversion_factor(unit: str, other: str) -> float | None:
    """Return the factor from `unit` to `other`, 1 for two spellings of one unit.

    Returns None if they differ in dimension, or if one is not known.
    """
    factors = unit_factors(unit)
    if unit == other or (factors is not None and factors == unit_factors(other)):
        return 1.0
    size, other_size = unit_size(unit), unit_size(other)
    return size[0] / other_size[0] if size and other_size and size[1] == other_size[1] else None


@cache
def is_rate_unit(unit: str, base: str) -> bool:
    """Return whether `unit` is `base` per second; two empty units match."""
    powers = unit_factors(base)
    if powers is None or not (unit and base):
        return unit == base == ""
    slower = powers | {"s": powers.get("s", 0) - 1}
    return {name: power for name, power in slower.items() if power} == unit_factors(unit)
