"""One benchmark: measured value, target and baselines."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SETTINGS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("targets.toml").read_text(encoding="utf-8")
)


@dataclass(frozen=True)
class Baseline:
    """A comparison value from the same run; `value` is None for a remark or the reference of an error."""

    name: str
    value: float | None = None


@dataclass(frozen=True)
class Benchmark:
    """A measured `value` in `unit`, which should be at most `target`."""

    name: str
    value: float
    unit: str
    target: float
    baselines: tuple[Baseline, ...]

    @property
    def is_met(self) -> bool:
        return self.value <= self.target
