"""One number of the benchmark: what was measured, what is to be reached, and what stands beside it."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

NUMBERS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("reach.toml").read_text(encoding="utf-8"))


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
