"""Signals of an FMU or a file, for comparison."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .trajectory import ModeChanges, Trajectory


@dataclass(frozen=True)
class Signals:
    """Signals over time, from a run or a file.

    Attributes
    ----------
    time : numpy.ndarray
        Time (n,) in s.
    columns, units : dict
        Signals (n,) and units, by name.
    events : ModeChanges or None
        Changes of mode, if known.
    note, file, parameters
        Origin of the signals.
    failure : str
        Reason why they are incomplete; empty if they are complete.
    """

    name: str
    time: np.ndarray
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    events: ModeChanges | None = None
    note: str = ""
    file: Path | None = None
    parameters: Mapping[str, tuple[object, str]] = field(default_factory=dict)
    failure: str = ""


def signals_from_trajectory(run: Trajectory) -> Signals:
    """Return the signals of a run."""
    note = run.note or (f"solver: {run.settings_label}" if run.settings_label else "")
    units = {name: run.units[name] for name in run.columns}
    fmu, parameters = run.spec.fmu, run.effective_parameters
    return Signals(run.spec.model, run.time, run.columns, units, run.events, note, fmu, parameters, run.failure)
