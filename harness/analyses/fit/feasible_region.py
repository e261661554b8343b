"""Region that a fit may search: half spaces from bounds, and from values that the FMU refuses."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import nnls

from .unknowns import Unknown

MAX_PLANES = 40
BISECTIONS = 30
PROBE = 1e-3  # distance at which the direction of a boundary is probed


class FeasibleRegion:
    """Half spaces normal . z <= bound of the coordinates z (k,)."""

    def __init__(self, unknowns: Sequence[Unknown]) -> None:
        self.normals: list[np.ndarray] = []
        self.bounds: list[float] = []
        for axis, unknown in zip(np.eye(len(unknowns)), unknowns, strict=True):
            for low, high in (unknown.coordinate_bounds(), unknown.limits):
                for normal, bound in ((-axis, -low), (axis, high)):
                    if np.isfinite(bound):
                        self.add(normal, bound)

    def add(self, normal: np.ndarray, bound: float) -> None:
        self.normals.append(normal)
        self.bounds.append(bound)

    def add_refusal(self, is_refused: Callable[[np.ndarray], bool], z: np.ndarray, step: np.ndarray) -> None:
        """Add the plane beyond which the FMU refuses values, if it refuses z + step.

        The plane is found by bisection along the step, and its direction by bisection along each axis.
        """

        def accepted_share(start: np.ndarray, step: np.ndarray) -> float:
            low, high = 0.0, 1.0
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                low, high = (low, middle) if is_refused(start + middle * step) else (middle, high)
            return low

        if len(self.normals) > MAX_PLANES or not is_refused(z + step):
            return
        inside = z + step * max(accepted_share(z, step) - 1e-6, 0.0)
        normal = np.zeros(len(z))
        for i, axis in enumerate(PROBE * np.eye(len(z))):
            for side in (1, -1):
                if is_refused(inside + side * axis):
                    normal[i] = side / (PROBE * max(accepted_share(inside, side * axis), 1e-9))
        if normal.any():
            size = np.linalg.norm(normal)
            self.add(normal / size, float((normal @ inside + 1) / size) - 1e-9)

    def constrained_step(self, matrix: np.ndarray, slope: np.ndarray, z: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Return the step s of the `free` coordinates with the least s.matrix.s/2 + slope.s inside the region.

        NaN if there is none.

        References
        ----------
        C. L. Lawson, R. J. Hanson, Solving Least Squares Problems (1974), chapter 23
        """
        s = -np.linalg.solve(matrix, slope)
        normals = np.array(self.normals)
        slack, normals = np.array(self.bounds) - normals @ z, normals[:, free]
        if (normals @ s <= slack + 1e-12).all():
            return np.asarray(s)
        # relative to the largest element, as the limits of this method are absolute
        transform = np.linalg.inv(np.linalg.cholesky(matrix / matrix.max(initial=1e-300))).T
        left, right = -normals @ transform, normals @ s - slack
        u, _ = nnls(np.vstack([left.T, right]), np.append(np.zeros(len(free)), 1.0))
        r = np.append(left.T @ u, right @ u - 1)
        return np.asarray(s - transform @ (r[:-1] / r[-1])) if r[-1] < -1e-12 else np.full(len(free), np.nan)
