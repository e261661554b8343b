"""How the error of a coupled run falls with its communication step."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Convergence:
    """What is `read` (element, variable, value reference) in an archive, with `labels` and `units`, at communication
    `steps` in s up to the `stop`; its set of `values`.

    Found are the columns `x` (m, n) at `time` (m,) with the finest step, the `reference` in words and its `truth`
    (m, n), for each step the largest of the `errors`, and for each engine the last row, its largest error with the
    finest step, and why there is none.
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
    def unit(self) -> str:
        """That of all that is read, if it has one."""
        return self.units[0] if len(set(self.units)) == 1 else ""

    @property
    def order(self) -> float:
        """The power of the step with which the error falls, from the two finest steps; NaN with one."""
        if len(self.errors) < 2 or not all(self.errors[-2:]):
            return float("nan")
        steps = self.steps[: len(self.errors)]
        return float(np.log(self.errors[-2] / self.errors[-1]) / np.log(steps[-2] / steps[-1]))
