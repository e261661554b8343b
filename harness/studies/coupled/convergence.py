"""Convergence of a coupled run with its communication step."""

from dataclasses import dataclass, field
from math import isnan

import numpy as np

from .engine import MAIN_ENGINE


@dataclass(frozen=True)
class Convergence:
    """Convergence study of an archive: settings and results.

    Attributes
    ----------
    caption : str
        Title of the scene.
    read : tuple of (str, str, int)
        Recorded variables: element, variable, value reference.
    labels, units : tuple of str
        Labels and units of these variables.
    steps : tuple of float
        Communication steps in s, decreasing.
    stop : float
        Stop time in s.
    reference : str
        Description of the reference.
    values : str
        Name of the parameter set in the archive.
    candidates : tuple of str
        Engines for the runs at all steps; the first one that runs the archive is used.
    unsupported : dict
        Reasons of the engines that do not support the archive.
    ignored : tuple of str
        Parameters of the archive that reach no variable of an FMU.
    time : numpy.ndarray
        Times (m,) in s of the run with the smallest step.
    x : numpy.ndarray
        Recorded values (m, n) of that run.
    truth : numpy.ndarray
        Reference values (m, n).
    errors : tuple of float
        Largest error for each step.
    engines : dict
        For each engine: last row, largest error at the smallest step, and the reason if it failed.
    """

    caption: str
    read: tuple[tuple[str, str, int], ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    steps: tuple[float, ...]
    stop: float
    reference: str
    values: str = "initialValues"
    candidates: tuple[str, ...] = (MAIN_ENGINE,)
    unsupported: dict[str, str] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()
    time: np.ndarray = field(default_factory=lambda: np.zeros(0))
    x: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    truth: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    errors: tuple[float, ...] = ()
    engines: dict[str, tuple[tuple[float, ...], float, str]] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the recorded variables."""
        return tuple(f"{element}.{variable}" for element, variable, _ in self.read)

    @property
    def unit(self) -> str:
        """Return the common unit of the variables, or an empty string."""
        return self.units[0] if len(set(self.units)) == 1 else ""

    @property
    def order(self) -> float:
        """Return the order of convergence from the errors at the two smallest steps; NaN without two errors above 0."""
        if len(self.errors) < 2 or not all(self.errors[-2:]):
            return float("nan")
        steps = self.steps[: len(self.errors)]
        return float(np.log(self.errors[-2] / self.errors[-1]) / np.log(steps[-2] / steps[-1]))

    @property
    def order_text(self) -> str:
        """Return the order of convergence in words."""
        return "not known, it needs errors at two steps" if isnan(self.order) else f"{self.order:.2f}"
