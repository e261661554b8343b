"""Certified references: the default run of each model under each law, with its changes of mode.

certification.py writes the numbers next to the file of the model: stickslip.csv, whose first line names the
methods, and stickslip-events.csv; those of other laws and values under longer names, such as stickslip-threshold.csv.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import nan
from pathlib import Path

import numpy as np

from ..scenes.run_spec import RunSpec
from ..simulation.solution import Solution
from .ode_problem import OdeProblem

FOLDER = Path(__file__).parents[2] / "fmus"
ERROR_LABEL = ", relative difference "  # in the first line of a file, between the methods and the estimated error
POINTS = 401  # common output points of every run, including start and stop


@dataclass(frozen=True)
class ReferenceCase:
    """A run of a model under one law whose result is certified.

    Attributes
    ----------
    name : str
    run : RunSpec
        The FMU, the values to set, and the states among its outputs.
    law : str
        Description of the friction law.
    reference_source : str or Solution
        The reference of this law, or its name.
    problem : OdeProblem
        The equations for peer solvers.
    dry_friction_reference : str or None
        Name of the reference with dry friction, if the law only approximates it.
    """

    name: str
    run: RunSpec
    law: str
    reference_source: str | Solution
    problem: OdeProblem
    dry_friction_reference: str | None = None

    @property
    def model(self) -> str:
        """Return the name of the model."""
        return self.run.model

    @property
    def is_chattering(self) -> bool:
        """Whether friction jumps within a step without an event; peer solvers are not made for that."""
        return "friction" in self.run.values

    @property
    def reference(self) -> Solution:
        """The reference of the law."""
        if isinstance(self.reference_source, str):
            return load_reference(self.reference_source)
        return self.reference_source


@dataclass(frozen=True)
class SolutionErrors:
    """Errors of a solution relative to the largest of the reference motion, the larger of position and velocity.

    Attributes
    ----------
    final : float
        Error at the end.
    rms, largest : float
        Root mean square and largest error over the common points.
    events : float or None
        Largest error of the event times in s; None without events, NaN if their number or modes are wrong.
    """

    final: float
    rms: float
    largest: float
    events: float | None


@cache
def load_reference(name: str, folder: Path = FOLDER) -> Solution:
    """Read the reference of a name."""
    with (folder / f"{name}.csv").open(encoding="utf-8") as file:
        method, label, error = file.readline().strip("# \n").partition(ERROR_LABEL)
        times, *motion = np.loadtxt(file, delimiter=",", skiprows=1).T
    events, modes = folder / f"{name}-events.csv", np.empty((0, 2))
    if events.is_file():
        modes = np.loadtxt(events, delimiter=",", skiprows=1, ndmin=2)
    changes = [(t, int(mode)) for t, mode in modes.tolist()]
    return Solution(
        times,
        np.array(motion).T,
        changes[1:],
        start_mode=changes[0][1] if changes else None,
        method=method,
        estimated_error=float(error) if label else nan,
    )


def compute_errors(answer: Solution, reference: Solution) -> SolutionErrors:
    """Return the errors of a solution at the times of a reference."""
    error = relative_errors(answer.states, reference.states)
    has_events = answer.events is not None and reference.events is not None
    return SolutionErrors(
        final=float(error[-1]),
        rms=float(np.sqrt(np.mean(error * error))),
        largest=float(error.max()),
        events=event_time_error(answer.events or [], reference.events or []) if has_events else None,
    )


def relative_errors(motion: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return the largest error of the states at each point (n,), relative to the largest of the reference column."""
    largest = np.abs(reference).max(axis=0)
    return (np.abs(motion - reference) / np.where(largest > 0, largest, 1.0)).max(axis=1)


def max_relative_difference(reference: Solution, other: Solution) -> float:
    """Return the largest relative difference of two solutions."""
    return float(relative_errors(other.states, reference.states).max())


def event_time_error(events: Sequence[tuple[float, int]], reference: Sequence[tuple[float, int]]) -> float:
    """Return the largest error of event times in s; NaN if the number or the modes of the events differ."""
    if [mode for _, mode in events] != [mode for _, mode in reference]:
        return float("nan")
    return max((abs(t - true) for (t, _), (true, _) in zip(events, reference, strict=True)), default=0.0)
