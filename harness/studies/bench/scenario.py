"""What model exchange is measured in: a case as it is or with other values, its input led, begun at any time."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ...references.certified_reference import POINTS, ReferenceCase
from ...references.reference_trajectory import CommunicationGrid, compute_reference
from ...running.fmu_session import read_info
from .native import CASES_BY_NAME

InputSegment = tuple[float, float, float, float]  # from, to in s, the value at the beginning, and its rate


@dataclass(frozen=True, eq=False)
class Scenario:
    """The case of a name from `start` (s) on, with `values` beside its own: numbers, and for an input that is led the
    points through which it goes in straight lines, (s from the start, value) each; a time that stands twice is a jump.
    """

    case: str
    name: str = "default run"
    values: dict[str, Any] = field(default_factory=dict)
    start: float = 0.0

    def __str__(self) -> str:
        return f"{self.case}, {self.name}" + (f" from {self.start:g} s" if self.start else "")

    @property
    def reference_case(self) -> ReferenceCase:
        return CASES_BY_NAME[self.case]

    @property
    def is_default(self) -> bool:
        """Whether it is the case as it is certified."""
        return not self.values and not self.start

    @property
    def numbers(self) -> dict[str, float]:
        """What is set at the start."""
        return {
            **self.reference_case.values,
            **{name: value for name, value in self.values.items() if name not in self.led},
        }

    @property
    def led(self) -> dict[str, list[tuple[float, float]]]:
        """The points by time in s."""
        lists = {name: value for name, value in self.values.items() if isinstance(value, list)}
        return {name: [(self.start + t, value) for t, value in points] for name, points in lists.items()}

    @property
    def lines(self) -> list[InputSegment]:
        """The course of the input that is led; of none where it stays."""
        (points,) = self.led.values() or [[(self.start, 0.0), (self.stop, 0.0)]]
        between = pairwise(points)
        return [(t, end, value, (last - value) / (end - t)) for (t, value), (end, last) in between if end > t]

    @property
    def signals(self) -> np.ndarray | None:
        """The points as importers take them."""
        for name, points in self.led.items():
            return np.array(points, dtype=[("time", float), (name, float)])
        return None

    @property
    def has_ramps(self) -> bool:
        """Whether the input changes but by jumps."""
        return any(rate for *_, rate in self.lines)

    @property
    def stop(self) -> float:
        return self.start + self.reference_case.problem.stop

    @property
    def interval(self) -> float:
        """From one common time to the next, in s."""
        return self.reference_case.problem.stop / (POINTS - 1)

    @property
    def times(self) -> np.ndarray:
        """The common times, in s."""
        return self.start + self.reference_case.reference.times

    @cached_property
    def reference_motion(self) -> np.ndarray:
        """Position and speed (n, 2) at the common times."""
        if self.is_default:
            return self.reference_case.reference.motion
        known = read_info(self.reference_case.model)
        values = known.resolve_labels({**known.start_values, **self.numbers})
        lines = [(t, end, {**dict.fromkeys(self.led, value), "rate": rate}) for t, end, value, rate in self.lines]
        spans = [(t, end, {**values, **led}) for t, end, led in lines]
        found = compute_reference(
            self.reference_case.model, spans, CommunicationGrid(self.start, self.stop, POINTS - 1)
        )
        return np.column_stack([found.x, found.v])
