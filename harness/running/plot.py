"""Plots of a trajectory for interactive work; the studies draw the figures of result folders."""

from collections.abc import Mapping, Sequence

import numpy as np

PANEL = (7.0, 1.7)  # inches, width and height


def plot(
    time: np.ndarray, columns: Mapping[str, np.ndarray], sticking: Sequence[tuple[float, float]], title: str
) -> np.ndarray:
    """Plot columns by label over time with pyplot, so that notebooks show the figure.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times in s.
    columns : mapping
        Values (n,) of each panel by the label of its axis.
    sticking : sequence of pairs
        Intervals of time in s to shade.
    title : str
        Title of the figure.

    Returns
    -------
    ndarray
        The axes, one for each column.
    """
    import matplotlib.pyplot as plt

    width, height = PANEL
    figure, axes = plt.subplots(
        len(columns), sharex=True, squeeze=False, figsize=(width, height * len(columns) + 0.5), layout="constrained"
    )
    panels: np.ndarray = axes[:, 0]
    for panel, (label, values) in zip(panels, columns.items(), strict=True):
        panel.plot(time, values, drawstyle="steps-post" if values.dtype.kind in "iu" else "default")
        panel.set_ylabel(label)
        for begin, end in sticking:
            panel.axvspan(begin, end, color="0.5", alpha=0.15, linewidth=0)
    panels[-1].set_xlabel("time [s]")
    figure.suptitle(title)
    return panels
