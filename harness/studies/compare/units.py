"""Units in one spelling, and how large one is in another: m/s2 is m.s-2, m s^-2 and m/s/s; 180 deg are pi rad."""

import re
from collections import Counter
from functools import cache

from ...records.units import find_unit

SAME = (("²", "2"), ("³", "3"), ("⁻", "-"), ("¹", "1"), ("**", ""), ("^", ""), ("·", "."), ("*", "."), ("µ", "u"))
FACTOR = re.compile(r"([^\W\d_]+|°|%)(-?\d+)?|1")
ALIAS = {"Nm": "N.m", "degree": "deg", "degrees": "deg", "°": "deg", "sec": "s", "μ": "u"}


def parse_unit(unit: str) -> frozenset[tuple[str, int]] | str:
    """The powers of its factors; the text itself where it is no product of powers."""
    text = unit.strip()
    for old, new in SAME:
        text = text.replace(old, new)
    text = re.sub(r"\b(Nm|degrees?|sec)\b|°", lambda found: ALIAS[found[0]], text)
    powers: Counter[str] = Counter()
    above, *below = text.split("/")
    for sign, part in [(1, above), *((-1, part) for part in below)]:
        factors = [factor for factor in re.split(r"[.\s()]+", part) if factor]
        for factor in factors:
            found = FACTOR.fullmatch(factor)
            if not found:
                return unit
            if found[1]:
                powers[found[1]] += sign * int(found[2] or 1)
    return frozenset((name, power) for name, power in powers.items() if power)


def conversion_factor(unit: str, other: str) -> float | None:
    """How large a unit is in another; None if they do not measure the same thing, as far as is known here."""
    if parse_unit(unit) == parse_unit(other):
        return 1.0
    one, two = find_unit(unit), find_unit(other)
    if one and two and (one.order, one.base) == (two.order, two.base):
        return one.size / two.size
    return None


@cache
def is_rate_unit(unit: str, of: str) -> bool:
    """Whether a unit is another one per second; where neither is known, it may be."""
    powers = parse_unit(of)
    if isinstance(powers, str) or not (unit and of):
        return unit == of == ""
    slower = Counter(dict(powers))
    slower["s"] -= 1
    return frozenset((name, power) for name, power in slower.items() if power) == parse_unit(unit)
