"""Trajectory of a run: its signals, internal steps, statistics and specification."""

from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..results.quantity import Quantity
from ..scenes.run_spec import RunSpec
from .signals import Signals


@dataclass(frozen=True)
class SolverSteps:
    """Internal steps of the solver.

    Attributes
    ----------
    t : numpy.ndarray
        Start of the run and ends of the steps (n + 1,) in s.
    h : numpy.ndarray
        Step sizes (n,) in s.
    rejected : numpy.ndarray
        Number (n,) of rejected attempts before each step.
    """

    t: np.ndarray
    h: np.ndarray
    rejected: np.ndarray


@dataclass(frozen=True)
class Statistics:
    """Counts of a run.

    Attributes
    ----------
    steps, rejected : int
        Accepted and rejected steps of the solver.
    evaluations : int
        Evaluations of the right-hand side.
    seconds : float
        Run time in s of the fastest repetition.
    events : int
        Changes of mode.
    last_event : float
        Time of the last change of mode in s, or of the start without changes; NaN if the FMU does not expose it.
    """

    steps: int
    rejected: int
    evaluations: int
    seconds: float
    events: int = 0
    last_event: float = nan

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        return (
            Quantity("run_time", self.seconds, "s", "run time"),
            Quantity("evaluations", self.evaluations, "", "right-hand sides"),
        )


@dataclass(frozen=True, repr=False, kw_only=True)
class Trajectory(Signals):
    """Signals of one run.

    It is a mapping from the names of the recorded outputs to their values: ``run["x"]``, ``"x" in run``, ``dict(run)``.

    Attributes
    ----------
    spec : RunSpec
        Effective settings of the run.
    time : numpy.ndarray
        Time (n,) in s.
    columns : dict
        Recorded outputs (n,) by name.
    units : dict
        Units of columns and parameters by name.
    descriptions : dict
        Descriptions of columns by name.
    parameters : dict
        Effective values by name.
    steps, events, statistics : SolverSteps, ModeChanges, Statistics
        Internal steps, changes of mode, and counts; None if the FMU does not expose them.
    note : str
        Estimated accuracy.
    failure : str
        Reason why the run is incomplete; empty if it is complete.
    label : str
        Name for display; empty for that of the model.
    """

    spec: RunSpec
    parameters: dict[str, float | str] = field(default_factory=dict)
    steps: SolverSteps | None = None
    statistics: Statistics | None = None
    note: str = ""
    failure: str = ""

    @property
    def name(self) -> str:
        """Return the name for display."""
        return self.label or self.spec.model

    @property
    def source(self) -> Path:
        """Return the FMU."""
        return self.spec.fmu

    @property
    def _attributes(self) -> dict[str, Any]:
        return {"model": self.spec.model, **self.parameters}

    @property
    def settings_label(self) -> str:
        """Return method, friction law and tolerance for titles; empty for external FMUs."""
        words = [str(self.parameters[name]) for name in ("solver.method", "friction") if name in self.parameters]
        if "solver.rtol" in self.spec.values:
            words.append(f"rtol {self.spec.values['solver.rtol']:g}")
        return ", ".join(words)


def describe_accuracy(signals: Signals) -> str:
    """Return the estimated accuracy of a run, or the settings of the solver of an FMU of this project; else nothing."""
    if not isinstance(signals, Trajectory):
        return ""
    settings = f"solver: {signals.settings_label}" if signals.settings_label else ""
    return "; ".join(filter(None, [signals.note, settings]))


def effective_parameters(signals: Signals) -> dict[str, tuple[object, str]]:
    """Return value and unit of every parameter of a run, by name; nothing for other signals."""
    parameters = signals.parameters if isinstance(signals, Trajectory) else {}
    return {name: (value, signals.units[name]) for name, value in parameters.items()}


def get_parameter(run: Trajectory, name: str, purpose: str) -> float:
    """Return a parameter's value; raise HarnessError if the model does not have it."""
    value = run.parameters.get(name)
    if not isinstance(value, float):
        raise HarnessError(f"{purpose} needs the parameter '{name}', which {run.spec.model} does not have: remove it")
    return value
