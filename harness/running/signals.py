"""What anyone's FMU, or a file, shows of a motion: a trajectory."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .trajectory import Trajectory


@dataclass(frozen=True)
class Signals:
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
    failure: str = ""


def signals_from_trajectory(run: Trajectory) -> Signals:
    """The trajectory of a run."""
    events = None if run.events is None else np.column_stack([run.events.t, run.events.mode])
    note = run.note or (f"solver: {run.settings_label}" if run.settings_label else "")
    units = {name: run.units[name] for name in run.columns}
    fmu, told = run.spec.fmu, run.effective_parameters
    return Signals(run.spec.model, run.time, run.columns, units, events, note, fmu, told, run.failure)
