"""One number of the benchmark: what was measured, what is to be reached, and what stands beside it."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SETTINGS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("targets.toml").read_text(encoding="utf-8")
)


@dataclass(frozen=True)
class Baseline:
    """What a number is compared with, measured in the same run; `value` is None where it is what the error is from."""

    name: str
    value: float | None = None


@dataclass(frozen=True)
class Benchmark:
    """`value` in `unit`, to be at most `reach`."""

    name: str
    value: float
    unit: str
    target: float
    baselines: tuple[Baseline, ...]

    @property
    def is_met(self) -> bool:
        return self.value <= self.target
