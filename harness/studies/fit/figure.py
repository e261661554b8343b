"""Figure of a fit: record and fits, and the residuals of each law, for each observed column."""

from pathlib import Path

import numpy as np

from ...analyses.fit.parameter_fit import ColumnResiduals, ParameterFit
from ...results.quantity import display_unit
from ...results.style import BLUE, GREEN, GREY, HEIGHT, LEGEND_ABOVE, ORANGE, WIDTH, Axes, axis_label, open_figure

MAX_COLUMNS = 6  # that are drawn
COLOURS = (ORANGE, GREEN, "#CC79A7", "#56B4E9")  # of the laws
RECORD, RESIDUALS = 2.0, 1.0  # relative heights of the panels


def draw(fit: ParameterFit, path: Path) -> None:
    """Save the figure."""
    columns, laws = fit.columns[:MAX_COLUMNS], (fit, *fit.against)
    heights = [RECORD, *[RESIDUALS] * len(laws)] * len(columns)
    height = 0.53 * HEIGHT * sum(heights)
    with open_figure(path, 1.8 * WIDTH, height) as figure:
        axes = figure.subplots(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        for n, column in enumerate(columns):
            panels = axes[n * (len(laws) + 1) :][: len(laws) + 1]
            plot_column(panels, laws, n, column)
        axes[-1].set_xlabel("t [s]")


def plot_column(panels: np.ndarray, laws: tuple[ParameterFit, ...], n: int, column: ColumnResiduals) -> None:
    """Plot a column of a record with the fits, and below it the residuals of each law."""
    i, j = divmod(n, laws[0].predictions[0].shape[1])
    record = laws[0].records[i]
    unit, size = display_unit(column.unit)
    measured = record.y[:, j] / size
    panels[0].plot(record.t, measured, ".", markersize=2.5, color=BLUE, label="record")
    for law, axes, colour in zip(laws, panels[1:], COLOURS * len(laws), strict=False):
        fitted = law.predictions[i][:, j] / size
        panels[0].plot(record.t, fitted, color=colour, linewidth=0.9, label=f"fit: {law.fmu}")
        name = f" of {law.fmu}" if len(laws) > 1 else ""
        plot_residuals(axes, record.t, measured - fitted, float(record.noise[j]) / size, name, unit)
        axes.sharex(panels[0])
        axes.sharey(panels[1])
    panels[0].set_title(record.name)
    panels[0].set_ylabel(axis_label(column.name, unit))
    panels[0].legend(ncols=len(laws) + 1, **LEGEND_ABOVE)


def plot_residuals(axes: Axes, t: np.ndarray, e: np.ndarray, noise: float, name: str, unit: str) -> None:
    """Plot residuals and the band of the noise."""
    axes.plot(t, e, ".", markersize=2.5, color=BLUE)
    axes.axhspan(-noise, noise, color=GREY, alpha=0.2, linewidth=0)
    axes.axhline(0.0, color="black", linewidth=0.6)
    rms = float(np.sqrt(np.mean(e**2)))
    axes.set_title(f"residuals{name} (rms {rms:.3g} {unit}; the band is the noise)")
    axes.set_ylabel(axis_label("record - fit", unit))
