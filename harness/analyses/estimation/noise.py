"""Noise of the samples of a record, whatever its signal, and of the residuals of a fit."""

from collections.abc import Iterable

import numpy as np

SIGNIFICANT_CORRELATION = 4.5  # standard deviations of the correlation of white residuals: one record of 1e5
SIGNIFICANT_SUMS = 5.0  # standard deviations of the variance of sums of white residuals


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


def residual_correlation(e: np.ndarray, widths: Iterable[int]) -> tuple[float, bool]:
    """Return the correlation of neighbouring residuals e (n,), and whether they differ from white noise.

    They do if this correlation, or the variance of their sums over one of the `widths`, is significantly large.
    """
    squares, n = float(e @ e), len(e)
    if squares == 0:
        return 0.0, False
    rho = float(e[:-1] @ e[1:]) / squares
    is_correlated = abs(rho) > SIGNIFICANT_CORRELATION / np.sqrt(n)
    for width in widths:
        sums = np.add.reduceat(e, np.arange(0, n, width))
        ratio = float(np.mean(sums**2)) / (width * squares / n)
        is_correlated = is_correlated or ratio > 1 + SIGNIFICANT_SUMS * np.sqrt(2 * width / n)
    return rho, bool(is_correlated)


def block_scores(jacobian: np.ndarray, e: np.ndarray, count: int, n_unknowns: int) -> tuple[np.ndarray, float]:
    """Return the scores, products of columns (n, k) and residuals e (n,), summed over at most `count` blocks.

    The second result is the factor by which their squares are too small after a fit of `n_unknowns` values.
    """
    edges = np.unique(np.linspace(0, len(e), count + 1).astype(int))[:-1]
    scores = np.add.reduceat(jacobian * e[:, None], edges, axis=0)
    return scores, len(edges) / max(len(edges) - n_unknowns, 1)
