"""Specification of a run: the FMU, values to set, outputs to record."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any

from ..errors import SceneError
from ..scenes.roles import find_roles
from ..scenes.scene import NATURAL_NUMBER, REPEAT_COUNT, Scene
from ..scenes.schema import FLAG, NAMES, NUMBER, POSITIVE, TABLE, TEXT, parse_table
from .inputs import Inputs

# Keys of a scene that set a variable of the FMU.
SHORT_KEYS = {
    "method": "solver.method",
    "law": "friction",
    "rtol": "solver.rtol",
    "atol": "solver.atol",
    "h_max": "solver.h_max",
}
DEFAULT_EQUAL_STEPS = 4096  # communication steps of a scene without grid and follow


@dataclass(frozen=True)
class RunSpec:
    """Specification of one run of an FMU.

    Attributes
    ----------
    fmu : pathlib.Path
    outputs : tuple of str
        Outputs to record.
    values : mapping
        Values to set by variable name; enumerations by label or number.
    inputs : mapping
        Table of input signals: the column "time" in s and one column for each input.
    start, stop : float or None
        Start and stop in s; None for those of the FMU.
    grid : float or None
        Communication step in s.
    equal_steps : int
        Number of equal communication steps if there is no `grid`.
    follow : bool
        Whether to step to the ends of internal steps as well. An external FMU does not expose them; its communication
        steps are refined instead until two results agree to the `tolerance`.
    repeat : int
        Number of timed repetitions.
    tolerance : float
        Tolerance of the step refinement of external FMUs.
    exchange : bool
        Whether to use model exchange; automatic if the FMU offers nothing else. External FMUs only.
    lenient : bool
        Whether to run an FMU that violates the standard.
    timeout : float
        Time limit in s of one FMI call of an external FMU.
    """

    fmu: Path
    outputs: tuple[str, ...] = ()
    values: Mapping[str, float | str] = field(default_factory=dict)
    inputs: Inputs = field(default_factory=dict)
    start: float | None = None
    stop: float | None = None
    grid: float | None = None
    equal_steps: int = 0
    follow: bool = True
    repeat: int = 1
    tolerance: float = 1e-6
    exchange: bool = False
    lenient: bool = False
    timeout: float = 60.0

    @property
    def model(self) -> str:
        """Return the name of the model."""
        return self.fmu.stem

    @property
    def motion_outputs(self) -> dict[str, str]:
        """Return the recorded output of each role: position, velocity, acceleration."""
        return find_roles(self.outputs)


@dataclass(frozen=True, kw_only=True)
class StoredRunKeys:
    """Keys of a specification in provenance.json, without those that are null."""

    fmu: Annotated[str, TEXT]
    outputs: Annotated[tuple[str, ...], NAMES]
    values: Annotated[dict[str, Any], TABLE] = field(default_factory=dict)
    inputs: dict[str, tuple[Annotated[float, NUMBER], ...]] = field(default_factory=dict)
    start: Annotated[float | None, NUMBER] = None
    stop: Annotated[float | None, NUMBER] = None
    grid: Annotated[float | None, POSITIVE] = None
    equal_steps: Annotated[int, NATURAL_NUMBER] = 0
    follow: Annotated[bool, FLAG] = True
    repeat: Annotated[int, REPEAT_COUNT] = 1
    tolerance: Annotated[float, POSITIVE] = 1e-6
    exchange: Annotated[bool, FLAG] = False
    lenient: Annotated[bool, FLAG] = False
    timeout: Annotated[float, POSITIVE] = 60.0


def spec_from_provenance(stored: dict[str, Any]) -> RunSpec:
    """Return the run specification in the provenance of a result; raise SceneError if it is not valid."""
    keys = parse_table({name: value for name, value in stored.items() if value is not None}, StoredRunKeys)
    return RunSpec(**vars(keys) | {"fmu": Path(keys.fmu)})


def spec_from_scene(scene: Scene) -> RunSpec:
    """Return the run specification of a scene."""
    by_key = {name: getattr(scene, key) for key, name in SHORT_KEYS.items() if getattr(scene, key) is not None}
    for name in by_key:
        if name in scene.values:
            raise SceneError(f"{name} is set twice, in [values] and by its key: remove one")
    equal_steps = DEFAULT_EQUAL_STEPS if scene.follow is None else 0
    derived: dict[str, Any] = {
        "inputs": {},
        "fmu": scene.file,
        "values": by_key | scene.values,
        "equal_steps": equal_steps,
        "follow": scene.follows_solver_steps,
    }
    copied = {each.name: getattr(scene, each.name) for each in fields(RunSpec) if each.name not in derived}
    return RunSpec(**copied, **derived)
