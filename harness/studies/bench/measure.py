"""One number of the benchmark: what was measured, what is to be reached, and what stands beside it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Beside:
    """What a number is compared with, measured in the same run; `value` is None where it is what the error is from."""

    name: str
    value: float | None = None


@dataclass(frozen=True)
class Measure:
    """`value` in `unit`, to be at most `reach`."""

    what: str
    value: float
    unit: str
    reach: float
    beside: tuple[Beside, ...]

    @property
    def reached(self) -> bool:
        return self.value <= self.reach
