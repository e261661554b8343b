"""Sources of decays: record files, and runs of scenes."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ...analyses.decay.estimates import KnownParameters
from ...errors import HarnessError

if TYPE_CHECKING:
    from ...simulation.trajectory import Trajectory


def is_record_file(source: str) -> bool:
    """Return whether a source of the command decay is a record, not a scene."""
    path = Path(source)
    return source == "-" or (path.suffix.lower() != ".toml" and (path.is_file() or path.is_fifo() or bool(path.suffix)))


def read_parameters(trajectory: "Trajectory") -> KnownParameters:
    """Return the stiffness of the model of a run; a model without one has no friction force."""
    from ...analyses.decay.decrement import stiffness

    is_rotation = trajectory.units[trajectory.motion_outputs["position"]] == "rad"
    with suppress(HarnessError):
        return KnownParameters(stiffness(trajectory, is_rotation, "the decay of a run"), pendulum=is_rotation)
    return KnownParameters()
