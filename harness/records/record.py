"""A record of a free decay: what was measured, when, and in which unit."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..errors import SceneError

QUANTITIES = ("position", "velocity", "acceleration")  # by the order of the derivative that was recorded
MIN_SAMPLES = 12  # samples
MAX_VALUE = 1e100  # squares of it are numbers still


@dataclass(frozen=True)
class Record:
    """Values `x` (n,) in `unit` at the times `t` (n,) in s, rising; `order` 0, 1 or 2 says of which derivative of the
    position, whose own unit is `base` (m, rad, or what a sensor gives).  `notes`: what was done on reading."""

    name: str
    t: np.ndarray
    x: np.ndarray
    unit: str = "m"
    order: int = 0
    base: str = "m"
    notes: tuple[str, ...] = ()

    @property
    def quantity(self) -> str:
        return QUANTITIES[self.order]

    def format_time(self, t: float) -> str:
        """A time in s as a sentence has it: to a hundred thousandth of the record, however late its clock."""
        return f"{t:.{max(5 - int(np.ceil(np.log10(np.ptp(self.t)))), 0)}f}"

    def select(self, begin: float, end: float) -> Self:
        """The samples from `begin` to `end` in s."""
        inside = (self.t >= begin) & (self.t <= end)
        return replace(self, t=self.t[inside], x=self.x[inside])


def check_record(record: Record) -> None:
    """Samples enough, finite, and later each than the one before; SceneError where not."""
    if len(record.t) < MIN_SAMPLES:
        raise SceneError(f"{record.name} has {len(record.t)} samples in this stretch; {MIN_SAMPLES} or more are needed")
    for name, values in (("time", record.t), (record.quantity, record.x)):
        if not np.isfinite(values).all():
            raise SceneError(f"{record.name}: {name} is not finite in sample {int(np.argmin(np.isfinite(values)))}")
        if np.abs(values).max() > MAX_VALUE:
            raise SceneError(f"{record.name}: {name} is as large as {np.abs(values).max():.3g}, which nothing measures")
    late = np.flatnonzero(np.diff(record.t) <= 0)
    if len(late):
        at = float(record.t[late[0]])
        raise SceneError(f"{record.name}: time does not rise after t = {at!r} s; sort the rows, one for each time")
