"""The answer to compare with: the default experiment of each model under each law, certified, with its changes of mode.

The numbers lie beside the file of the model, as certified.py makes them: stickslip.csv, whose first line tells how, and
stickslip-events.csv; those of other laws and values under more of a name, as stickslip-threshold.csv.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from math import nan
from pathlib import Path

import numpy as np

from ..running.solution import Solution
from .ode_problem import OdeProblem

FOLDER = Path(__file__).parents[2] / "fmus"
ERROR_LABEL = ", relative difference "  # before it stands how the numbers were got
POINTS = 401  # common points of every run, start and stop included


@dataclass(frozen=True)
class ReferenceCase:
    """A model under one law: `values` to set in its FMU, the `truth` of that law or its name, the `problem` as peers
    write it, the name of the truth about `dry` friction if the law only approximates it, and the `outputs` that are the
    states; the model is a name, or the path of a file."""

    name: str
    model: str
    law: str
    reference_source: "str | CertifiedReference"
    problem: OdeProblem
    values: dict[str, float] = field(default_factory=dict)
    dry_friction_reference: str | None = None
    outputs: tuple[str, ...] = ("x", "v")

    @property
    def is_chattering(self) -> bool:
        """Whether friction jumps within a step, with no event: nothing that a peer is good for."""
        return "friction" in self.values

    @property
    def reference(self) -> "CertifiedReference":
        """The truth of the law."""
        return (
            load_reference(self.reference_source) if isinstance(self.reference_source, str) else self.reference_source
        )


@dataclass(frozen=True)
class CertifiedReference:
    """The states `motion` (n, states), position and speed first, at `times` (n,), and the `modes` (time in s, mode that
    holds from there on) of which the first is the start; none where nothing sticks.  SI units.  `doubt` is the largest
    difference of the two routes that led here, relative to the largest of each column; `how` names them."""

    times: np.ndarray
    motion: np.ndarray
    modes: list[tuple[float, int]]
    method: str
    estimated_error: float

    @property
    def events(self) -> list[tuple[float, int]]:
        """The changes of mode."""
        return self.modes[1:]


@dataclass(frozen=True)
class SolutionErrors:
    """At the end, root mean square and largest over the common points, of position and speed alike, each relative to
    the largest of the true motion; `events` in s is the largest of the event times, None if none were asked for and
    NaN if their number or their modes are not the true ones."""

    final: float
    rms: float
    largest: float
    events: float | None


@cache
def load_reference(name: str, folder: Path = FOLDER) -> CertifiedReference:
    """The reference of a name."""
    with (folder / f"{name}.csv").open(encoding="utf-8") as file:
        how, told, doubt = file.readline().strip("# \n").partition(ERROR_LABEL)
        times, *motion = np.loadtxt(file, delimiter=",", skiprows=1).T
    events, modes = folder / f"{name}-events.csv", np.empty((0, 2))
    if events.is_file():
        modes = np.loadtxt(events, delimiter=",", skiprows=1, ndmin=2)
    changes = [(t, int(mode)) for t, mode in modes.tolist()]
    return CertifiedReference(times, np.array(motion).T, changes, how, float(doubt) if told else nan)


def compute_errors(answer: Solution, truth: CertifiedReference) -> SolutionErrors:
    """How far an answer at the common points is from the truth."""
    off = relative_errors(answer.states, truth.motion)
    asked = answer.events is not None
    return SolutionErrors(
        final=float(off[-1]),
        rms=float(np.sqrt(np.mean(off * off))),
        largest=float(off.max()),
        events=event_time_error(answer.events or [], truth.events) if asked else None,
    )


def relative_errors(motion: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """The largest error of the states at each point (n,), relative to the largest of the true column."""
    largest = np.abs(truth).max(axis=0)
    return (np.abs(motion - truth) / np.where(largest > 0, largest, 1.0)).max(axis=1)


def max_relative_difference(one: Solution, other: Solution) -> float:
    """The largest error of an answer, the first being the truth."""
    return float(relative_errors(other.states, one.states).max())


def event_time_error(events: Sequence[tuple[float, int]], truth: Sequence[tuple[float, int]]) -> float:
    """The largest error of event times in s; NaN if their number or their modes differ."""
    if [mode for _, mode in events] != [mode for _, mode in truth]:
        return float("nan")
    return max((abs(t - true) for (t, _), (true, _) in zip(events, truth, strict=True)), default=0.0)
