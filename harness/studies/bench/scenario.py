"""Scenarios for benchmarks of model exchange: a case with other values, input signals or start time."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...references.certified_reference import POINTS, ReferenceCase
from ...references.reference_trajectory import CommunicationGrid, compute_reference
from ...running.fmu_info import read_info
from ...scenes.run_spec import RunSpec
from .native import CASES_BY_NAME

InputSegment = tuple[float, float, float, float]  # start and end in s, value at the start, and rate


@dataclass(frozen=True, eq=False)
class Scenario:
    """A case that starts at `start` s, with additional `values`.

    The value of a driven input is a list of points (s from the start, value), linear in between; a repeated time is a
    jump.
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
        """Return whether this is the unchanged case, which has a certified reference."""
        return not self.values and not self.start

    @property
    def numbers(self) -> dict[str, float]:
        """Return the start values."""
        return {
            **self.reference_case.values,
            **{name: value for name, value in self.values.items() if name not in self.led},
        }

    @property
    def led(self) -> dict[str, list[tuple[float, float]]]:
        """Return the points of driven inputs, with absolute times in s."""
        lists = {name: value for name, value in self.values.items() if isinstance(value, list)}
        return {name: [(self.start + t, value) for t, value in points] for name, points in lists.items()}

    @property
    def lines(self) -> list[InputSegment]:
        """Return the linear segments of the driven input, or one segment of zero."""
        (points,) = self.led.values() or [[(self.start, 0.0), (self.stop, 0.0)]]
        between = pairwise(points)
        return [(t, end, value, (last - value) / (end - t)) for (t, value), (end, last) in between if end > t]

    @property
    def inputs(self) -> dict[str, tuple[float, ...]]:
        """Return the table of input signals, empty without a driven input."""
        for name, points in self.led.items():
            times, values = zip(*points, strict=True)
            return {"time": times, name: values}
        return {}

    def run(self, fmu: Path, rtol: float, exchange: bool) -> RunSpec:
        """Return the run of an FMU at the common times, which also records the number of events."""
        case = self.reference_case
        values = self.numbers if exchange else {**self.numbers, "solver.rtol": rtol}
        return RunSpec(
            fmu,
            (*case.outputs, *["events.count"] * case.problem.has_dry_friction),
            values,
            self.inputs,
            self.start,
            self.stop,
            self.interval,
            follow=False,
            tolerance=rtol,
            exchange=exchange,
        )

    @property
    def has_ramps(self) -> bool:
        """Return whether the input has ramps."""
        return any(rate for *_, rate in self.lines)

    @property
    def stop(self) -> float:
        return self.start + self.reference_case.problem.stop

    @property
    def interval(self) -> float:
        """Return the interval of the common times in s."""
        return self.reference_case.problem.stop / (POINTS - 1)

    @property
    def times(self) -> np.ndarray:
        """Return the common times in s."""
        return self.start + self.reference_case.reference.times

    @cached_property
    def reference_motion(self) -> np.ndarray:
        """Return the reference position and speed (n, 2) at the common times."""
        if self.is_default:
            return self.reference_case.reference.motion
        info = read_info(self.reference_case.model)
        values = info.resolve_labels({**info.start_values, **self.numbers})
        lines = [(t, end, {**dict.fromkeys(self.led, value), "rate": rate}) for t, end, value, rate in self.lines]
        spans = [(t, end, {**values, **driven}) for t, end, driven in lines]
        reference = compute_reference(
            self.reference_case.model, spans, CommunicationGrid(self.start, self.stop, POINTS - 1)
        )
        return np.column_stack([reference.x, reference.v])
