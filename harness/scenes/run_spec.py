"""Specification of a run: the FMU, values to set, outputs to record, and how it is run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from ..arguments import NAMES, POSITIVE, SETTINGS, Rule, increasing_row, whole_number
from .roles import find_roles
from .schema import field_names, parse_table

DEFAULT_EQUAL_STEPS = 4096  # communication steps of a run that sets neither `grid` nor `follow`
DEFAULT_TOLERANCE = 1e-6
MAX_REPEATS = 1000
if TYPE_CHECKING:
    import numpy as np

    Numbers = tuple[float, ...] | np.ndarray
else:
    Numbers = tuple[float, ...]  # in files; importing numpy would take time in every command


def increasing_times(value: Any) -> tuple[float, ...]:
    """Return increasing finite numbers, or none."""
    return tuple(increasing_row(value).tolist()) if value != [] else ()


TIMES = Rule("a list of increasing finite numbers", increasing_times)


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """How an FMU is run: times, inputs and limits.

    Attributes
    ----------
    inputs : mapping
        Table of input signals: the column "time" in s and one column for each input, tuples or arrays.
    start, stop : float or None
        Start and stop in s. None stands for those of the FMU, or for a stop at the last of the `times`.
    grid : float or None
        Communication step in s.
    times : tuple of float, or numpy.ndarray
        Increasing times in s to record; empty to record every point. Communication steps end at these times, and at
        the rows of the inputs.
    equal_steps : int
        Number of equal communication steps if there is no `grid`.
    interval : float or None
        Time in s between recorded points: its multiples and the last point are recorded. None to record every point.
    follow : bool
        Whether to step to the ends of internal steps as well. An external FMU does not expose them; its communication
        steps are refined instead until two results agree to the `tolerance`.
    repeat : int
        Number of timed repetitions.
    tolerance : float or None
        Relative tolerance of the step refinement of external FMUs, or of the solver in model exchange. A run of an
        external FMU that misses it fails. With None, 1e-6 is the aim, and a run that misses it is a result whose error
        is stated.
    exchange : bool
        Whether to use model exchange; always used if an external FMU offers nothing else. External FMUs only.
    lenient : bool
        Whether to run an FMU that violates the standard.
    timeout : float
        Time limit in s of one FMI call of an external FMU. An FMU of this project must advance by 1/4096 of the run in
        this time.
    """

    inputs: Mapping[str, Numbers] = field(default_factory=dict)
    start: float | None = None
    stop: float | None = None
    grid: Annotated[float | None, POSITIVE] = None
    times: Annotated[Numbers, TIMES] = ()
    equal_steps: int = 0
    interval: Annotated[float | None, POSITIVE] = None
    follow: bool = True
    repeat: Annotated[int, whole_number(1, MAX_REPEATS)] = 1
    tolerance: Annotated[float | None, POSITIVE] = None
    exchange: bool = False
    lenient: bool = False
    timeout: Annotated[float, POSITIVE] = 60.0

    @property
    def rtol(self) -> float:
        """Return the relative tolerance to aim at."""
        return DEFAULT_TOLERANCE if self.tolerance is None else self.tolerance


@dataclass(frozen=True)
class RunSpec(RunOptions):
    """Specification of one run of an FMU.

    Scenes, commands, the Python API, sweeps and stability cases build one for each run. Its JSON is stored in the
    provenance of a result, and `from_json` reads it. Further attributes are those of `RunOptions`.

    Attributes
    ----------
    fmu : pathlib.Path
        Path of the FMU.
    outputs : tuple of str
        Outputs to record.
    values : dict
        Values to set by variable name; enumerations by label or number.
    """

    fmu: Path
    outputs: Annotated[tuple[str, ...], NAMES] = ()
    values: Annotated[dict[str, Any], SETTINGS] = field(default_factory=dict)

    @classmethod
    def from_json(cls, table: Mapping[str, Any]) -> "RunSpec":
        """Return the specification in a table, where null stands for a default; SceneError if it is invalid."""
        return parse_table({name: value for name, value in table.items() if value is not None}, cls)

    @property
    def options(self) -> dict[str, Any]:
        """Return all settings except the FMU."""
        return {name: value for name, value in vars(self).items() if name != "fmu"}

    @property
    def model(self) -> str:
        """Return the name of the model."""
        return self.fmu.stem

    @property
    def motion_outputs(self) -> dict[str, str]:
        """Return the recorded output of each role: position, velocity, acceleration."""
        return find_roles(self.outputs)


# keys of a scene file that set its run; the FMU has other keys, and a scene records every point or its `times`
SCENE_KEYS = tuple(name for name in field_names(RunSpec) if name not in ("fmu", "equal_steps", "interval"))
