"""The answer to compare with: the default experiment of each model under each law, certified, with its changes of mode.

The numbers stand in harness/references/*.csv; __main__.py, which makes them, shares no code with the FMUs.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from ..running.answer import Answer
from .problem import Coulomb, Equations, Pacejka, Pendulum, Reaction, Smd, Stickslip

FOLDER = Path(__file__).parents[1] / "references"
POINTS = 401  # common points of every run, start and stop included


@dataclass(frozen=True)
class Case:
    """A model under one law: `values` to set in its FMU, the name of the `truth` of that law, the `problem` as peers
    write it, and the name of the truth about `dry` friction if the law only approximates it."""

    name: str
    model: str
    law: str
    truth: str
    problem: Equations
    values: dict[str, float] = field(default_factory=dict)
    dry: str | None = None

    @property
    def chatters(self) -> bool:
        """Whether friction jumps within a step, with no event: nothing that a peer is good for."""
        return "friction" in self.values

    @property
    def outputs(self) -> tuple[str, str]:
        """The outputs that are position and speed."""
        return ("theta", "omega") if self.problem.unit == "rad" else ("x", "v")


def magic(x_m: str) -> Case:
    """The sled with the magic formula."""
    problem, name = Pacejka(float(x_m)), f"pacejka-{x_m}"
    return Case(name, "pacejka", f"magic formula, x_m = {x_m} m/s", name, problem, {"x_m": float(x_m)}, "stickslip")


CASES = (
    Case("smd", "smd", "linear damping", "smd", Smd()),
    Case("coulomb", "coulomb", "hybrid", "coulomb", Coulomb()),
    Case("coulomb-sign", "coulomb", "sign", "coulomb", Coulomb(), {"friction": 2}, "coulomb"),
    Case("stickslip", "stickslip", "hybrid", "stickslip", Stickslip()),
    Case("stickslip-threshold", "stickslip", "threshold", "threshold", Stickslip(), {"friction": 3}, "stickslip"),
    *map(magic, ("0.01", "0.001", "0.0001")),
    Case("pendulum", "pendulum", "hybrid, pin load weight", "pendulum", Pendulum()),
    Case("pendulum-reaction", "pendulum", "hybrid, pin load reaction", "reaction", Reaction(), {"pin_load": 2}),
)
MODELS = tuple(dict.fromkeys(case.model for case in CASES))


@dataclass(frozen=True)
class Reference:
    """Positions and speeds `motion` (n, 2) at `times` (n,), and the `modes` (time in s, mode that holds from there on)
    of which the first is the start; none where nothing sticks.  SI units.  `doubt` is the largest difference of the
    two routes that led here, relative to the largest of each column."""

    name: str
    times: np.ndarray
    motion: np.ndarray
    modes: list[tuple[float, int]]
    doubt: float

    @property
    def events(self) -> list[tuple[float, int]]:
        """The changes of mode."""
        return self.modes[1:]


@dataclass(frozen=True)
class Errors:
    """At the end, root mean square and largest over the common points, of position and speed alike, each relative to
    the largest of the true motion; `events` in s is the largest of the event times, None if none were asked for and
    NaN if their number or their modes are not the true ones."""

    final: float
    rms: float
    largest: float
    events: float | None


@cache
def load(name: str) -> Reference:
    """The reference of a name."""
    table = np.loadtxt(FOLDER / f"{name}.csv", delimiter=",", skiprows=1)
    modes = [(float(row["t [s]"]), int(row["mode"])) for row in rows(f"{name}-events.csv")]
    doubt = {row["reference"]: float(row["difference [1]"]) for row in rows("agreement.csv")}[name]
    return Reference(name, table[:, 0], table[:, 1:], modes, doubt)


def rows(file: str) -> list[dict[str, str]]:
    """The rows of a table by the names in its first line."""
    with (FOLDER / file).open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


def errors(answer: Answer, truth: Reference) -> Errors:
    """How far an answer at the common points is from the truth."""
    off = relative(answer.motion, truth.motion)
    asked = answer.events is not None
    return Errors(
        final=float(off[-1]),
        rms=float(np.sqrt(np.mean(off * off))),
        largest=float(off.max()),
        events=late(answer.events or [], truth.events) if asked else None,
    )


def relative(motion: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """The larger error of position and speed at each point (n,), relative to the largest of the true column."""
    return (np.abs(motion - truth) / np.abs(truth).max(axis=0)).max(axis=1)


def late(events: Sequence[tuple[float, int]], truth: Sequence[tuple[float, int]]) -> float:
    """The largest error of event times in s; NaN if their number or their modes differ."""
    if [mode for _, mode in events] != [mode for _, mode in truth]:
        return float("nan")
    return max((abs(t - true) for (t, _), (true, _) in zip(events, truth, strict=True)), default=0.0)
