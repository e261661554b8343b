"""Convergence of a coupled run with its communication step."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Convergence:
    """Convergence study of an archive: settings and results.

    Attributes
    ----------
    title
        Title of the scene.
    read
        Recorded variables: element, variable, value reference.
    labels, units
        Labels and units of these variables.
    steps
        Communication steps in s, decreasing.
    stop
        Stop time in s.
    reference
        Description of the reference.
    values
        Name of the parameter set in the archive.
    time : (m,)
        Times in s of the run with the smallest step.
    x : (m, n)
        Recorded values of that run.
    truth : (m, n)
        Reference values.
    errors
        Largest error for each step.
    engines
        For each engine: last row, largest error at the smallest step, and the reason if it failed.
    """

    title: str
    read: tuple[tuple[str, str, int], ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    steps: tuple[float, ...]
    stop: float
    reference: str
    values: str = "initialValues"
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
        """Return the order of convergence from the two smallest steps; NaN if there is only one."""
        if len(self.errors) < 2 or not all(self.errors[-2:]):
            return float("nan")
        steps = self.steps[: len(self.errors)]
        return float(np.log(self.errors[-2] / self.errors[-1]) / np.log(steps[-2] / steps[-1]))
