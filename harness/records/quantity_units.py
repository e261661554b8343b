"""Conversion between units of any quantity, as in kN, mm/s, N.m/rad or lbf.in.

Angles are numbers, so that N.m/rad is N.m. Cycles are not: Hz is neither 1/s nor rad/s, which differ by 2 pi in use.
"""

import re
from collections import Counter

from .units import ANGLES, CHARACTER_SUBSTITUTES, LENGTHS, STANDARD_GRAVITY, TIMES, UNIT_SYNONYMS, find_unit

POUND = 0.45359237  # kg
Powers = dict[str, int]  # powers of the base units kg, m, s, A and K, and of cycles
PREFIXES = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9, "m": 1e-3, "u": 1e-6, "n": 1e-9, "c": 1e-2, "d": 1e-1}
NAMED: dict[str, tuple[float, Powers]] = {
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
PREFIXED: dict[str, tuple[float, Powers]] = {
    "g": (1e-3, {"kg": 1}),
    "m": (1.0, {"m": 1}),
    "s": (1.0, {"s": 1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "Pa": (1.0, {"kg": 1, "m": -1, "s": -2}),
    "J": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "V": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "A": (1.0, {"A": 1}),
    "K": (1.0, {"K": 1}),
}
FACTOR = re.compile(r"([^\W\d_]+|°|%)(-?\d+)?|1")
TORQUES = {"Nm": "N.m", "Nmm": "N.mm", "kNm": "kN.m"}
SYNONYMS = UNIT_SYNONYMS | {"°": "deg", "sec": "s"}


def unit_factors(text: str) -> Powers | None:
    """Return the powers of the factors of a unit by name, as in {"m": 1, "s": -2} for m/s2, m.s-2 and m s^-2.

    None if it is not a unit. The names need not be known.
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
        known = named_unit(name)
        if not known:
            return None
        size *= known[0] ** power
        for base, exponent in known[1].items():
            totals[base] += power * exponent
    return size, {base: power for base, power in totals.items() if power}


def named_unit(name: str) -> tuple[float, Powers] | None:
    """Return a unit of one word, with a prefix or without."""
    if name in NAMED:
        return NAMED[name]
    for prefix, factor in PREFIXES.items():
        unit = PREFIXED.get(name.removeprefix(prefix)) if name.startswith(prefix) else None
        if unit:
            return factor * unit[0], unit[1]
    return None


def conversion_factor(unit: str, other: str) -> float | None:
    """Return the factor from `unit` to `other`, 1 for two spellings of one unit.

    None if they differ in dimension or one is not known.
    """
    factors = unit_factors(unit)
    if unit == other or (factors is not None and factors == unit_factors(other)):
        return 1.0
    one, two = unit_size(unit), unit_size(other)
    return one[0] / two[0] if one and two and one[1] == two[1] else None
