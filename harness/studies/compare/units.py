"""Unit spellings and conversion factors: m/s2, m.s-2, m s^-2 and m/s/s are equal; 180 deg are pi rad."""

import re
from collections import Counter
from functools import cache

from ...records.units import find_unit

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


def conversion_factor(unit: str, other: str) -> float | None:
    """Return the factor from `unit` to `other`; None if they are incompatible or unknown."""
    if parse_unit(unit) == parse_unit(other):
        return 1.0
    one, two = find_unit(unit), find_unit(other)
    if one and two and (one.order, one.base) == (two.order, two.base):
        return one.size / two.size
    return None


@cache
def is_rate_unit(unit: str, of: str) -> bool:
    """Return whether `unit` is `of` per second; two empty units match."""
    powers = parse_unit(of)
    if isinstance(powers, str) or not (unit and of):
        return unit == of == ""
    slower = Counter(dict(powers))
    slower["s"] -= 1
    return frozenset((name, power) for name, power in slower.items() if power) == parse_unit(unit)
