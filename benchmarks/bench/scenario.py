"""Scenarios for benchmarks of model exchange: a case with other values, input signals or start time."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from harness.references.certified_reference import POINTS, ReferenceCase
from harness.references.reference_trajectory import CommunicationGrid, compute_reference
from harness.scenes.run_spec import RunSpec
from harness.simulation.fmu_info import read_info

from .native import CASES_BY_NAME

DEFAULT_RUN = "default run"
InputSegment = tuple[float, float, float, float]  # start and end in s, value at the start, and rate


@dataclass(frozen=True, eq=False)
class Scenario:
    """A case with a run on the grid of its reference; `name` is for people."""

    case: ReferenceCase
    name: str
    run: RunSpec

    def __str__(self) -> str:
        return f"{self.case.name}, {self.name}" + (f" from {self.start:g} s" if self.start else "")

    @property
    def start(self) -> float:
        """Return the start in s."""
        return self.run.start or 0.0

    @property
    def stop(self) -> float:
        """Return the stop in s."""
        return self.start + self.case.problem.stop

    @property
    def is_default(self) -> bool:
        """Return whether this is the unchanged case, which has a certified reference."""
        return self.name == DEFAULT_RUN

    @property
    def segments(self) -> list[InputSegment]:
        """Return the linear segments of the driven input, or one segment of zero."""
        times, values = self.run.inputs.values() or ((self.start, self.stop), (0.0, 0.0))
        point_pairs = pairwise(zip(times, values, strict=True))
        return [(t, end, value, (last - value) / (end - t)) for (t, value), (end, last) in point_pairs if end > t]

    @property
    def has_ramps(self) -> bool:
        """Return whether the input has ramps."""
        return any(rate for *_, rate in self.segments)

    @property
    def times(self) -> np.ndarray:
        """Return the common times in s."""
        return self.start + self.case.reference.times

    def run_with(self, fmu: Path, rtol: float, exchange: bool) -> RunSpec:
        """Return the run of an FMU with a tolerance."""
        values = self.run.values if exchange else {**self.run.values, "solver.rtol": rtol}
        return replace(self.run, fmu=fmu, values=values, tolerance=rtol, exchange=exchange)

    @cached_property
    def reference_motion(self) -> np.ndarray:
        """Return the reference position and speed (n, 2) at the common times."""
        if self.is_default:
            return self.case.reference.states
        info, input_names = read_info(self.case.model), [name for name in self.run.inputs if name != "time"]
        values = info.resolve_labels({**info.start_values, **self.run.values})
        spans = [
            (t, end, {**values, **dict.fromkeys(input_names, value), "rate": rate})
            for t, end, value, rate in self.segments
        ]
        grid = CommunicationGrid(self.start, self.stop, POINTS - 1)
        return compute_reference(self.case.model, spans, grid).states


def make_scenario(
    case_name: str, name: str = DEFAULT_RUN, changes: Mapping[str, Any] | None = None, start: float = 0.0
) -> Scenario:
    """Return a case with changed values that starts at `start` s, and records the number of events as well.

    The value of a driven input is a list of points (s from the start, value), linear in between; a repeated time is a
    jump.
    """
    case, values, inputs = CASES_BY_NAME[case_name], {}, {}
    for variable, value in (changes or {}).items():
        if isinstance(value, list):
            times, column = zip(*value, strict=True)
            inputs = {"time": tuple(start + t for t in times), variable: column}
        else:
            values[variable] = value
    run = replace(
        case.run,
        outputs=(*case.run.outputs, *["events.count"] * case.problem.has_dry_friction),
        values={**case.run.values, **values},
        inputs=inputs,
        start=start,
        stop=start + case.problem.stop,
        grid=case.problem.stop / (POINTS - 1),
        follow=False,
    )
    return Scenario(case, name, run)
