"""The cases of the suite, each with what it catches, and their certified results.

A result is that of harness/references, which shares no code with the FMUs, or the certified result of a default run
that stands next to its model file.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from harness.references.certified_reference import FOLDER, load_reference
from harness.references.models import MODEL_MODULES
from harness.references.reference_trajectory import CommunicationGrid, compute_reference
from harness.simulation.fmu_info import read_info
from harness.simulation.solution import Solution
from harness.studies.stability.study import value_spans

TOLERANCE = 1e-6  # of the motion, relative to the largest value of a state
POINTS = 400  # communication steps


@dataclass(frozen=True)
class SuiteCase:
    """A run of one FMU.

    Attributes
    ----------
    name, model : str
    catches : str
        What a tool does wrong that fails in this case.
    stop : float or None
        Stop time in s; None for the default run, whose certified result stands next to the model file.
    start : float
        Start time in s.
    values : dict
        Start values other than those of the FMU.
    changes : dict
        Values of the input by the times in s at which it jumps to them.
    tolerance : float
        Largest error, relative to the largest value of a state.
    """

    name: str
    model: str
    catches: str
    stop: float | None = None
    start: float = 0.0
    values: dict[str, float] = field(default_factory=dict)
    changes: dict[float, float] = field(default_factory=dict)
    tolerance: float = TOLERANCE

    @property
    def model_file(self) -> Path:
        """Return the file of the model."""
        (file,) = (file for folder in (FOLDER, FOLDER / "more") if (file := folder / f"{self.model}.py").is_file())
        return file

    def solve(self, fmu: Path) -> Solution:
        """Return the certified result; `fmu` has the start values of the model."""
        if self.stop is None:
            return load_reference(self.model, self.model_file.parent)
        values = read_info(str(fmu)).start_values | self.values
        if self.changes:
            values["F_ext"] = self.changes[self.start]
        changes = {t: {"F_ext": force} for t, force in self.changes.items() if t > self.start}
        spans = value_spans(self.start, self.stop, values, changes)
        return compute_reference(self.model, spans, CommunicationGrid(self.start, self.stop, POINTS, tuple(changes)))

    @property
    def states(self) -> tuple[str, ...]:
        """Return the names of the states."""
        if self.model not in MODEL_MODULES:
            headings = self.model_file.with_suffix(".csv").read_text(encoding="utf-8").splitlines()[1].split(",")
            return tuple(heading.partition(" ")[0] for heading in headings[1:])
        return ("theta", "omega") if self.model == "pendulum" else ("x", "v")


def modes_at(solution: Solution, times: np.ndarray) -> np.ndarray | None:
    """Return the mode (n,) after the events at each time (n,) in s; None without certified events."""
    if solution.start_mode is None:
        return None
    changes = np.array([t for t, _ in solution.events or ()])
    modes = np.array([solution.start_mode, *(mode for _, mode in solution.events or ())])
    return np.asarray(modes[np.searchsorted(changes, times, side="right")])


CASES = (
    SuiteCase(
        "rest",
        "coulomb",
        "A mass stops at 4.0 s and stays for 16 s: creep, chatter, and steps that are spent on a mass at rest.",
        stop=20.0,
    ),
    SuiteCase(
        "stick_slip", "stickslip", "Four slips in 16 s: a stick or a slip that begins a communication step late."
    ),
    SuiteCase(
        "tie",
        "coulomb",
        "The spring pulls with exactly the force that friction holds, so the mass stays: a comparison with a margin.",
        stop=4.0,
        values={"k": 64.0, "m": 1.0, "f": 0.5, "x0": 0.0078125, "v0": 0.0},
    ),
    SuiteCase(
        "above_a_tie",
        "coulomb",
        "The spring pulls with a millionth more than friction holds; the mass moves by 15 nm: absolute tolerances.",
        stop=4.0,
        values={"k": 64.0, "m": 1.0, "f": 0.5, "x0": 0.0078125 * (1.0 + 2.0**-20), "v0": 0.0},
        tolerance=1e-9,
    ),
    SuiteCase(
        "short_sticks",
        "stickslip",
        "The driver is fast, so the sled sticks for 1.7 ms between slips: sticks within a communication step.",
        stop=8.0,
        values={"v_driver": 1.0, "mu_s": 0.605},
    ),
    SuiteCase(
        "jump_of_load",
        "coulomb",
        "A force jumps to 2 N and back while the mass is at rest: inputs that are interpolated across their jumps.",
        stop=8.0,
        values={"x0": 0.0, "v0": 0.0},
        changes={0.0: 0.0, 1.0: 2.0, 2.5: 0.0, 4.0: 0.4, 5.0: 0.6},
    ),
    SuiteCase(
        "late_start",
        "coulomb",
        "Starts at 100 000 s, and the force jumps after 1 s: a start time that is ignored, times in single precision.",
        start=100000.0,
        stop=100004.0,
        values={"x0": 0.0, "v0": 0.0},
        changes={100000.0: 0.0, 100001.0: 2.0},
    ),
    SuiteCase(
        "nanometres",
        "coulomb",
        "A decay of 1 nm: absolute tolerances, and results with few digits.",
        stop=4.0,
        values={"x0": 1e-9, "f": 5e-9},
    ),
    SuiteCase(
        "long_stick",
        "stickslip",
        "The driver is slow, and the first slip comes after 1486 s: steps that grow beyond the slip.",
        stop=2000.0,
        values={"v_driver": 1e-4},
    ),
    SuiteCase("no_friction", "smd", "A spring with viscous damping, without events: the error of the tool alone."),
    SuiteCase("creep", "pacejka", "The magic formula creeps where dry friction sticks, stiffly and without events."),
    SuiteCase("pendulum", "pendulum", "Angles in rad whose display unit is deg, and a stop at an angle above zero."),
    SuiteCase("belt", "belt", "Stick-slip on a moving belt with a Stribeck curve: a stick that moves."),
    SuiteCase("clutch", "clutch", "Two inertias that lock: a change in the number of moving bodies."),
    SuiteCase("forced", "forced", "A force drives the mass through many short sticks in each period."),
    SuiteCase("table", "servo", "A friction curve given by points: kinks that are events."),
    SuiteCase(
        "stiff_bristle", "elastoplastic", "A stiff bristle deflects before it slides: steps larger than its time."
    ),
    SuiteCase("lugre", "lugre", "The LuGre law: a stiff internal state without events."),
    SuiteCase("coupled", "sleds", "Several sleds that pull each other: sticks that end because another sled slips."),
    SuiteCase("stacked", "stacked", "A block on a block: two contacts that act on one body."),
    SuiteCase(
        "plane",
        "puck",
        "A body turns to the fall of a tilted plate until it stops: friction that acts on each axis alone.",
    ),
)
