"""Units of rates."""

from functools import cache

from ...records.quantity_units import unit_factors


@cache
def is_rate_unit(unit: str, of: str) -> bool:
    """Return whether `unit` is `of` per second; two empty units match."""
    powers = unit_factors(of)
    if powers is None or not (unit and of):
        return unit == of == ""
    slower = powers | {"s": powers.get("s", 0) - 1}
    return {name: power for name, power in slower.items() if power} == unit_factors(unit)
