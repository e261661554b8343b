"""What a run leaves: time, columns, steps, events, cost, and what was wanted."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import HarnessError
from ..results.files import write_csv, write_signals
from ..results.quantity import Quantity
from .run_spec import RunSpec


@dataclass(frozen=True)
class SolverSteps:
    """The solver's own steps: `t` (n + 1,) their ends in s, start included; `h` (n,) in s; `rejected` (n,) refusals."""

    t: np.ndarray
    h: np.ndarray
    rejected: np.ndarray


@dataclass(frozen=True)
class ModeChanges:
    """Changes of mode: `mode` (n,) holds from `t` (n,) in s on; the first entry is the start."""

    t: np.ndarray
    mode: np.ndarray


@dataclass(frozen=True)
class Statistics:
    """Accepted steps, refused steps, right-hand sides, and the `seconds` of stepping in the fastest repeat."""

    steps: int
    rejected: int
    evaluations: int
    seconds: float

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        return (
            Quantity("run_time", self.seconds, "s", "run time"),
            Quantity("evaluations", self.evaluations, "", "right-hand sides"),
        )


@dataclass(frozen=True)
class Trajectory:
    """One run: `time` (n,) in s, `columns` name to (n,); `units` of these and of the parameters; `steps`, `events` and
    `cost` where the FMU shows them.  `note` says how exact it is, and `failed` why it is not whole."""

    spec: RunSpec
    time: np.ndarray
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    descriptions: dict[str, str]
    parameters: dict[str, float | str]
    steps: SolverSteps | None = None
    events: ModeChanges | None = None
    statistics: Statistics | None = None
    note: str = ""
    failure: str = ""

    @property
    def settings_label(self) -> str:
        """Method, law and tolerance in force, for titles; nothing of somebody's FMU."""
        words = [str(self.parameters[name]) for name in ("solver.method", "friction") if name in self.parameters]
        if "solver.rtol" in self.spec.values:
            words.append(f"rtol {self.spec.values['solver.rtol']:g}")
        return ", ".join(words)

    @property
    def effective_parameters(self) -> dict[str, tuple[object, str]]:
        """The value of every parameter, and its unit."""
        return {name: (value, self.units[name]) for name, value in self.parameters.items()}

    def column_of_role(self, role: str) -> np.ndarray:
        """The recorded position, velocity or acceleration (n,)."""
        return self.columns[self.spec.motion_outputs[role]]

    def get_parameter(self, name: str, purpose: str) -> float:
        """A parameter's value in the run; HarnessError if the model has none of that name."""
        value = self.parameters.get(name)
        if not isinstance(value, float):
            raise HarnessError(
                f"{purpose} needs the parameter '{name}', which {self.spec.model} does not have: leave it out"
            )
        return value

    def save(self, folder: Path) -> None:
        """Write trajectory.csv, and steps.csv and events.csv where there are any."""
        write_signals(folder / "trajectory.csv", self.time, self.columns, self.units)
        if self.steps:
            columns = [self.steps.t[1:], self.steps.h, self.steps.rejected]
            write_csv(folder / "steps.csv", ["t [s]", "h [s]", "rejected"], columns)
        if self.events:
            write_csv(folder / "events.csv", ["t [s]", "mode"], [self.events.t, self.events.mode])
