"""Peaks, decrements, rests, slips and steps of any sampled motion, such as the arrays of a solver."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import check_names, import_optional
from ..results.quantity import Quantity
from ..results.summary import ResultColumn, ResultTable, format_blocks, format_html
from .decay.decrement import find_extrema_from_velocity

if TYPE_CHECKING:
    import pandas

TEXT_WIDTH = 100  # characters of a line of `str`
COLUMNS = (
    ResultColumn("quantity", "{0.text}", is_text=True),
    ResultColumn("value", lambda quantity: quantity.format()[0]),
    ResultColumn("unit", lambda quantity: quantity.format()[1], is_text=True),
)
SLOW = 1e-3  # of the largest speed: below it a body rests, or creeps
SHORTEST_REST = 0.2  # of the median time between rests, unless the speed is exactly 0: turning points are shorter


@dataclass(frozen=True)
class MotionMeasures:
    """What `measure` finds in a sampled motion.

    Attributes
    ----------
    turning_t, turning_x : numpy.ndarray
        Times (n,) in s and positions (n,) of the turning points outside of rests.
    rest_begin, rest_end : numpy.ndarray
        First and last times (m,) in s at which the body rests, or creeps at less than 0.1 % of the largest speed.
    quantities : tuple of Quantity
        Numbers with name, value, unit and text, as the table shows them.
    """

    turning_t: np.ndarray
    turning_x: np.ndarray
    rest_begin: np.ndarray
    rest_end: np.ndarray
    quantities: tuple[Quantity, ...]

    @property
    def decrements(self) -> np.ndarray:
        """Return the fall (n - 1,) of the peaks in each half cycle: constant with dry friction."""
        return -np.diff(np.abs(self.turning_x))

    @property
    def log_decrements(self) -> np.ndarray:
        """Return the logarithm (n - 1,) of the ratio of successive peaks: constant with viscous damping."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return -np.diff(np.log(np.abs(self.turning_x)))

    def __getitem__(self, name: str) -> float:
        """Return the value of a quantity by its name."""
        values = {quantity.name: quantity.value for quantity in self.quantities}
        check_names("quantity", [name], values)
        return values[name]

    @property
    def _table(self) -> ResultTable:
        """The table of all quantities."""
        return ResultTable(self.quantities, COLUMNS)

    def __str__(self) -> str:
        return format_blocks([self._table], TEXT_WIDTH)

    def _repr_html_(self) -> str:
        """Return the table for notebooks."""
        return format_html([self._table])

    def to_pandas(self) -> "pandas.DataFrame":
        """Convert the quantities to a DataFrame with a row for each; HarnessError if pandas is not installed."""
        library = import_optional("pandas", "to_pandas()", "sweep")
        frame: pandas.DataFrame = library.DataFrame(self._table.records()).set_index("name")
        return frame


def measure_motion(t: np.ndarray, x: np.ndarray, v: np.ndarray, unit: str) -> MotionMeasures:
    """Measure a motion: turning points, decrements, rests, slips and steps.

    Parameters
    ----------
    t, x, v : numpy.ndarray
        Times (n,) in s, which rise, positions (n,) and velocities (n,), which are not all zero.
    unit : str
        Unit of the positions.
    """
    first, last = find_rests(t, v)
    turning_t, turning_x = find_extrema_from_velocity(t, x, v)
    moves = np.searchsorted(t[first], turning_t, "right") == np.searchsorted(t[last], turning_t, "left")
    turning_t, turning_x = turning_t[moves], turning_x[moves]
    measures = MotionMeasures(turning_t, turning_x, t[first], t[last], ())
    steps = np.diff(t)
    quantities = [
        Quantity("steps", len(steps), "", "steps"),
        Quantity("smallest_step", float(steps.min()), "s", "smallest step"),
        Quantity("median_step", float(np.median(steps)), "s", "median step"),
        Quantity("largest_step", float(steps.max()), "s", "largest step"),
        Quantity("turning_points", len(turning_t), "", "turning points"),
    ]
    if len(turning_t) > 1:
        decrements, ratios = measures.decrements, measures.log_decrements
        quantities += [
            Quantity("period", 2 * float(np.mean(np.diff(turning_t))), "s", "period"),
            Quantity("decrement", float(np.mean(decrements)), unit, "fall of the peaks in a half cycle, mean"),
            Quantity("decrement_range", float(np.ptp(decrements)), unit, "fall of the peaks in a half cycle, range"),
            Quantity("log_decrement", 2 * float(np.mean(ratios)), "1", "logarithmic decrement of a cycle, mean"),
            Quantity("log_decrement_range", 2 * float(np.ptp(ratios)), "1", "logarithmic decrement of a cycle, range"),
        ]
    quantities.append(Quantity("rests", len(first), "", "rests"))
    if len(first):
        begin, end = (first + last) // 2, (first + 3 * last) // 4  # within the rest: arrived, and not yet leaving
        creep = np.abs(x[end] - x[begin]) / np.where(end > begin, t[end] - t[begin], np.inf)
        sign = np.sign(v)
        reversals = sum(int((sign[i:j] * sign[i + 1 : j + 1] < 0).sum()) for i, j in zip(begin, end, strict=True))
        quantities += [
            Quantity("creep", float(creep.max()), f"{unit}/s", "creep at rest, largest"),
            Quantity("chatter", reversals, "", "changes of sign of the velocity at rest"),
        ]
        quantities += slip_quantities(t, first, last)
    return replace(measures, quantities=tuple(quantities))


def find_rests(t: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and the last samples (m,) of the intervals in which the body rests or creeps."""
    speed = np.abs(v)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], speed <= SLOW * speed.max(), [0]))))
    first, last = edges[::2], edges[1::2] - 1
    moves = np.append(t[first], t[-1]) - np.append(t[0], t[last])
    moves = moves[moves > 0]
    shortest = SHORTEST_REST * float(np.median(moves)) if len(moves) else 0.0
    is_zero = np.append((v[:-1] == 0) & (v[1:] == 0), False)
    zeros = np.append(0, np.cumsum(is_zero))
    is_rest = (t[last] - t[first] > shortest) | (zeros[last] > zeros[first])
    return first[is_rest], last[is_rest]


def slip_quantities(t: np.ndarray, first: np.ndarray, last: np.ndarray) -> list[Quantity]:
    """Return count, start, period and duration of the slips, each of which lies between two rests."""
    starts = t[last[last < len(t) - 1]]
    ends = t[first[first > 0]]
    ends = ends[ends > starts[0]] if len(starts) else ends[:0]
    quantities = [Quantity("slips", len(starts), "", "slips from rest")]
    if len(starts):
        quantities.append(Quantity("first_slip", float(starts[0]), "s", "first slip"))
    if len(starts) > 1:
        quantities.append(Quantity("slip_period", float(np.mean(np.diff(starts))), "s", "slip period"))
    if len(ends):
        quantities.append(Quantity("slip_time", float(np.mean(ends - starts[: len(ends)])), "s", "duration of a slip"))
    return quantities
