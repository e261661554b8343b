"""Noise of the samples of a record, whatever its signal."""

import numpy as np


def interpolation_residuals(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the distances (n - 4,) of the inner samples of x (n,) from the cubic through their four neighbours.

    They are scaled so that white noise keeps its standard deviation.
    """
    n = len(t) - 4
    near = np.array([t[i : i + n] for i in (0, 1, 3, 4)])
    weights = np.ones((4, n))
    for i in range(4):
        for j in range(4):
            if i != j:
                weights[i] *= (t[2:-2] - near[j]) / (near[i] - near[j])
    residuals = x[2:-2] - sum(weight * x[i : i + n] for weight, i in zip(weights, (0, 1, 3, 4), strict=True))
    return np.asarray(np.abs(residuals) / np.sqrt(1 + (weights**2).sum(axis=0)))


def robust_std(e: np.ndarray) -> float:
    """Return the standard deviation of residuals e (n,), estimated from their median magnitude."""
    return 1.4826 * float(np.median(np.abs(e)))
