"""Samples of one measured motion over time, and the checks of samples."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..arguments import QUANTITIES
from ..errors import SceneError, option_text

SYMBOLS = ("x", "v", "a")
RATE_SUFFIXES = ("", "/s", "/s2")  # of the unit, by the order of the derivative
NO_UNIT = "units"  # of a position without a unit
MIN_SAMPLES = 12  # samples
MAX_VALUE = 1e100  # its square is finite
MIN_DURATION = 1e-30  # s; the squares of frequencies are finite


@dataclass(frozen=True)
class Motion:
    """Samples of a measured motion.

    Attributes
    ----------
    name : str
        Name of the record.
    t : numpy.ndarray
        Times (n,) in s, increasing.
    x : numpy.ndarray
        Values (n,) in `unit`.
    unit : str
        Unit of the values: an SI unit, or that of a sensor.
    order : int
        Order of the derivative of the position that was measured: 0, 1 or 2.
    base : str
        Unit of the position: m, rad, or that of a sensor.
    notes : tuple of str
        Assumptions and corrections made when reading.
    """

    name: str
    t: np.ndarray
    x: np.ndarray
    unit: str = "m"
    order: int = 0
    base: str = "m"
    notes: tuple[str, ...] = ()

    @property
    def quantity(self) -> str:
        """Return the measured quantity."""
        return QUANTITIES[self.order]

    @property
    def symbol(self) -> str:
        """Return the symbol of the measured quantity."""
        return SYMBOLS[self.order]

    def format_time(self, t: float) -> str:
        """Return a time in s for messages, with a resolution of 1e-5 of the record."""
        return f"{t:.{max(5 - int(np.ceil(np.log10(np.ptp(self.t)))), 0)}f}"

    def select(self, begin: float, end: float) -> Self:
        """Return the samples from `begin` to `end` in s."""
        in_range = (self.t >= begin) & (self.t <= end)
        return replace(self, t=self.t[in_range], x=self.x[in_range])


def selection_text() -> str:
    """Return the options that select a part of a record."""
    return f"{option_text('begin')} and {option_text('end')}"


def check_samples(name: str, t: np.ndarray, x: np.ndarray, quantity: str = "position") -> None:
    """Check that a record has enough finite samples x (n,) at increasing times t (n,) in s.

    Raises
    ------
    SceneError
        If it has not.
    """
    if len(t) < MIN_SAMPLES:
        raise SceneError(f"{name} has {len(t)} samples in this interval; at least {MIN_SAMPLES} are required")
    for label, values in (("time", t), (quantity, x)):
        if not np.isfinite(values).all():
            raise SceneError(f"{name}: {label} is not finite in sample {int(np.argmin(np.isfinite(values)))}")
        if np.abs(values).max() > MAX_VALUE:
            raise SceneError(f"{name}: {label} is as large as {np.abs(values).max():.3g}, which is not plausible")
    if np.ptp(t) < MIN_DURATION:
        raise SceneError(f"{name} lasts {np.ptp(t):.3g} s, which is not plausible: check the times")
    not_increasing = np.flatnonzero(np.diff(t) <= 0)
    if len(not_increasing):
        time = float(t[not_increasing[0]])
        raise SceneError(
            f"{name}: time does not rise after t = {time!r} s; sort the rows, keep one row for each time, and "
            "save a second run in a separate file"
        )
