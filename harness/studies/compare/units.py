"""Unit spellings and factors for comparisons: m/s2, m.s-2, m s^-2 and m/s/s are equal."""

import re
from collections import Counter
from functools import cache

from ...records.quantity_units import conversion_factor

SPELLINGS = (("²", "2"), ("³", "3"), ("⁻", "-"), ("¹", "1"), ("**", ""), ("^", ""), ("·", "."), ("*", "."), ("µ", "u"))
FACTOR = re.compile(r"([^\W\d_]+|°|%)(-?\d+)?|1")
ALIAS = {"Nm": "N.m", "degree": "deg", "degrees": "deg", "°": "deg", "sec": "s", "μ": "u"}


def parse_unit(unit: str) -> frozenset[tuple[str, int]] | str:
    """Return the factors of a unit with their powers, or the unit itself if it cannot be parsed."""
    text = unit.strip()
    for old, new in SPELLINGS:
        text = text.replace(old, new)
    text = re.sub(r"\b(Nm|degrees?|sec)\b|°", lambda match: ALIAS[match[0]], text)
    powers: Counter[str] = Counter()
    above, *below = text.split("/")
    for sign, part in [(1, above), *((-1, part) for part in below)]:
        factors = [factor for factor in re.split(r"[.\s()]+", part) if factor]
        for factor in factors:
            match = FACTOR.fullmatch(factor)
            if not match:
                return unit
            if match[1]:
                powers[match[1]] += sign * int(match[2] or 1)
    return frozenset((name, power) for name, power in powers.items() if power)


def comparison_factor(unit: str, other: str) -> float | None:
    """Return the factor from `unit` to `other`, 1 for two spellings of one unit; None if they are incompatible."""
    return 1.0 if parse_unit(unit) == parse_unit(other) else conversion_factor(unit, other)


@cache
def is_rate_unit(unit: str, of: str) -> bool:
    """Return whether `unit` is `of` per second; two empty units match."""
    powers = parse_unit(of)
    if isinstance(powers, str) or not (unit and of):
        return unit == of == ""
    slower = Counter(dict(powers))
    slower["s"] -= 1
    return frozenset((name, power) for name, power in slower.items() if power) == parse_unit(unit)
