"""Figure of a fit: record and fit, and residuals, for each observed column."""

from pathlib import Path

import numpy as np

from ...analyses.fit.parameter_fit import ParameterFit
from ...results.quantity import display_unit
from ...results.style import BLUE, GREY, HEIGHT, ORANGE, WIDTH, axis_label, open_figure

MAX_COLUMNS = 6  # that are drawn


def draw(fit: ParameterFit, path: Path) -> None:
    """Save the figure."""
    columns = fit.columns[:MAX_COLUMNS]
    n_outputs = fit.predictions[0].shape[1]
    heights = (2, 1) * len(columns)
    with open_figure(path, 1.8 * WIDTH, 1.6 * HEIGHT * len(columns)) as figure:
        axes = figure.subplots(2 * len(columns), 1, height_ratios=heights, squeeze=False)[:, 0]
        for n, column in enumerate(columns):
            i, j = divmod(n, n_outputs)
            record, upper, lower = fit.records[i], axes[2 * n], axes[2 * n + 1]
            unit, size = display_unit(column.unit)
            t, measured, fitted = record.t, record.y[:, j] / size, fit.predictions[i][:, j] / size
            upper.plot(t, measured, ".", markersize=2.5, color=BLUE, label="record")
            upper.plot(t, fitted, color=ORANGE, linewidth=0.9, label=f"fit: {fit.fmu}")
            upper.set_title(record.name)
            upper.set_ylabel(axis_label(column.name, unit))
            upper.legend(loc="upper right", ncols=2)
            upper.sharex(lower)
            lower.plot(t, measured - fitted, ".", markersize=2.5, color=BLUE)
            noise = float(record.noise[j]) / size
            lower.axhspan(-noise, noise, color=GREY, alpha=0.2, linewidth=0)
            lower.axhline(0.0, color="black", linewidth=0.6)
            rms = float(np.sqrt(np.mean((measured - fitted) ** 2)))
            lower.set_title(f"residuals (rms {rms:.3g} {unit}; the band is the noise)")
            lower.set_ylabel(axis_label("record - fit", unit))
        axes[-1].set_xlabel("t [s]")
