"""How the error of a coupled run falls with its communication step."""

from dataclasses import dataclass

import numpy as np

from ...scenes.coupled.scene import Coupled


@dataclass(frozen=True)
class Convergence:
    """Positions `x` (m, n) at `time` (m,) with the finest communication step, the reference `truth` (m, n), and for
    each of the `steps` in s the largest `error` of a position, in m."""

    scene: Coupled
    time: np.ndarray
    x: np.ndarray
    truth: np.ndarray
    steps: tuple[float, ...]
    errors: tuple[float, ...]

    @property
    def order(self) -> float:
        """The power of the step with which the error falls, from the two finest steps; NaN with one."""
        if len(self.steps) < 2 or not all(self.errors[-2:]):
            return float("nan")
        return float(np.log(self.errors[-2] / self.errors[-1]) / np.log(self.steps[-2] / self.steps[-1]))
