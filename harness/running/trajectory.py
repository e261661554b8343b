"""What anyone's FMU, or a file, shows of a motion: a trajectory."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .run import Run


@dataclass(frozen=True)
class Trajectory:
    """`columns` name to (n,) over `time` (n,) in s, with their units; the times of `events` and the modes that begin
    there (m, 2), the start included, where they are known.  `note`, `file` and `parameters` say where it
    came from, `failed` why it is not whole."""

    name: str
    time: np.ndarray
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    events: np.ndarray | None = None
    note: str = ""
    file: Path | None = None
    parameters: Mapping[str, tuple[object, str]] = field(default_factory=dict)
    failed: str = ""


def of_run(run: Run) -> Trajectory:
    """The trajectory of a run."""
    events = None if run.events is None else np.column_stack([run.events.t, run.events.mode])
    note = run.note or (f"solver: {run.setting}" if run.setting else "")
    units = {name: run.units[name] for name in run.columns}
    fmu, told = run.wanted.fmu, run.in_force
    return Trajectory(run.wanted.model, run.time, run.columns, units, events, note, fmu, told, run.failed)
