"""Sources of decays: record files, and runs of scenes."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from os.path import exists
from pathlib import Path
from typing import TYPE_CHECKING

from ...analyses.decay.estimates import KnownParameters
from ...errors import HarnessError, SceneError, format_value
from ...records.columns import ColumnOptions
from ...records.record import Record, load_record

if TYPE_CHECKING:
    from ...simulation.trajectory import Trajectory


def is_record_file(source: str) -> bool:
    """Return whether a source of the command decay is a record, not a scene."""
    path = Path(source)
    return source == "-" or (path.suffix.lower() != ".toml" and (path.is_file() or path.is_fifo() or bool(path.suffix)))


def load_source(source: str, columns: ColumnOptions, report: Callable[[float], None]) -> "Record | Trajectory":
    """Return the record in a file, or the run of a scene under its name.

    Raises
    ------
    HarnessError
        If there is no such source, or the run fails or has no position.
    """
    if is_record_file(source):
        if source != "-" and not exists(source):
            raise SceneError(f"{format_value(source)} does not exist: give an existing record, or a scene")
        return load_record(source, columns)
    if Path(source).is_dir():
        raise SceneError(f"{source} is a folder; give a file in it")
    from ...scenes.fmu_files import check_built
    from ...scenes.scene import load_scene
    from ...simulation.runner import run

    scene = load_scene(source)
    check_built(scene.run.fmu)
    if "position" not in scene.run.motion_outputs:
        raise SceneError(f"scene {scene.name}: a decay needs the position among the outputs")
    trajectory = run(scene.run, report)
    if trajectory.failure:
        raise HarnessError(f"scene {scene.name}: {trajectory.failure}")
    position = trajectory.motion_outputs["position"]
    if not trajectory.units[position]:
        raise SceneError(
            f"scene {scene.name}: {position} has no unit in {scene.run.fmu.name}: run the scene, and identify the "
            "decay in its trajectory.csv with --unit"
        )
    return replace(trajectory, label=scene.name)


def read_parameters(trajectory: "Trajectory") -> KnownParameters:
    """Return the stiffness of the model of a run; a model without one has no friction force."""
    from ...analyses.decay.decrement import stiffness

    is_rotation = trajectory.units[trajectory.motion_outputs["position"]] == "rad"
    with suppress(HarnessError):
        return KnownParameters(stiffness(trajectory, is_rotation, "the decay of a run"), pendulum=is_rotation)
    return KnownParameters()
