"""What to run: an FMU, what to set in it, and what to record."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..errors import SceneError
from ..scenes.roles import find_roles
from ..scenes.scene import Scene
from .inputs import Inputs

# Keys of a scene that are short for a variable of the FMU.
SHORT_KEYS = {
    "method": "solver.method",
    "law": "friction",
    "rtol": "solver.rtol",
    "atol": "solver.atol",
    "h_max": "solver.h_max",
}
DEFAULT_EQUAL_STEPS = 4096  # communication steps of a scene that says nothing of them: enough to draw and to measure


@dataclass(frozen=True)
class RunSpec:
    """One run of an FMU, from `start` to `stop` in s (None: its own).

    `values` are set by the names of variables, enumerations by label or number; `inputs` is a table over time.  The
    communication points are those of the `grid` (a step in s, if there is one; `even`: without one, that of so many
    steps), and where it is to `follow` them the ends of the solver's own steps.  It is timed as often as it is to
    `repeat`.

    Somebody else's FMU does not show its solver's steps: what is followed are ever shorter ones, until two results
    agree to the `tolerance`.  It is run by model exchange if `exchange` or if it offers nothing else; if `lenient` also
    when it breaks the standard; and one call of it may take `timeout` s.
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
        return self.fmu.stem

    @property
    def motion_outputs(self) -> dict[str, str]:
        """The output that plays each role, of those recorded."""
        return find_roles(self.outputs)


def spec_from_scene(scene: Scene) -> RunSpec:
    """The run that a scene asks for."""
    short = {name: getattr(scene, key) for key, name in SHORT_KEYS.items() if getattr(scene, key) is not None}
    for name in short:
        if name in scene.values:
            raise SceneError(f"{name} is set twice, in [values] and above: leave one out")
    even = DEFAULT_EQUAL_STEPS if scene.follow is None else 0
    own: dict[str, Any] = {
        "inputs": {},
        "fmu": scene.file,
        "values": short | scene.values,
        "equal_steps": even,
        "follow": scene.follows_solver_steps,
    }
    same = {each.name: getattr(scene, each.name) for each in fields(RunSpec) if each.name not in own}
    return RunSpec(**same, **own)
