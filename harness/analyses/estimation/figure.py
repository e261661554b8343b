"""Panels in the figures of `decay` and `fit`: a record, and the residuals of a fit."""

from typing import Any

import numpy as np

from ...results.style import BLUE, GREY, LEGEND_ABOVE, Axes, axis_label

MAX_POINTS = 4000  # of a line


def plot_record(axes: Axes, t: np.ndarray, x: np.ndarray, title: str, label: str) -> None:
    """Plot a record, with a title and the label of its values."""
    plot_samples(axes, t, x, color=BLUE, label="record")
    axes.set_title(title)
    axes.set_ylabel(label)


def plot_legend(axes: Axes) -> None:
    """Plot the legend of a record and its fits above their panel."""
    axes.legend(ncols=len(axes.get_legend_handles_labels()[0]), **LEGEND_ABOVE)


def plot_residuals(axes: Axes, t: np.ndarray, e: np.ndarray, noise: float, name: str, unit: str) -> None:
    """Plot residuals, of the fit `name`, and the band of the noise."""
    plot_samples(axes, t, e, color=BLUE)
    axes.axhspan(-noise, noise, color=GREY, alpha=0.2, linewidth=0)
    axes.axhline(0.0, color="black", linewidth=0.6)
    rms = float(np.sqrt(np.mean(e**2)))
    axes.set_title(f"residuals{name} (rms {rms:.3g} {unit}; the band is the noise)")
    axes.set_ylabel(axis_label("record - fit", unit))


def plot_samples(axes: Axes, t: np.ndarray, x: np.ndarray, **style: Any) -> None:
    """Plot samples, reduced to extremes if there are many."""
    index = extremes(x)
    axes.plot(t[index], x[index], ".", markersize=2.5, **style)


def extremes(x: np.ndarray) -> np.ndarray:
    """Return the indices of all samples of x (n,), or of the first, lowest and highest sample of each of MAX_POINTS/2
    intervals; the others lie between these values."""
    if len(x) <= MAX_POINTS:
        return np.arange(len(x))
    size = -(-2 * len(x) // MAX_POINTS)
    intervals = np.minimum(np.arange(0, len(x), size)[:, None] + np.arange(size), len(x) - 1)
    low, high = x[intervals].argmin(axis=1), x[intervals].argmax(axis=1)
    return np.unique(intervals[:, 0] + [np.zeros_like(low), low, high])
