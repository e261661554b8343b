"""Figure of a coupled scene: motion and reference, and error over the communication step."""

from itertools import cycle
from math import isnan

import numpy as np

from ...results.style import BLUE, GREEN, GREY, HEIGHT, ORANGE, WIDTH, Axes, Figure, axis_label, set_size
from .convergence import Convergence

MAX_PANELS = 8  # variables with a panel
MORE_COLOURS = ("#CC79A7", "#56B4E9", "#E69F00")  # further colours


def draw(study: Convergence, figure: Figure) -> None:
    """Draw the figure."""
    kinds = [*dict.fromkeys(zip([name for _, name, _ in study.read], study.units, strict=True))][:MAX_PANELS]
    set_size(figure, 2.2 * WIDTH, max(1.6, len(kinds)) * HEIGHT)
    figure.suptitle(study.caption, fontsize=11)
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(3, 2))[0]
    panels = left.subplots(len(kinds), sharex=True, squeeze=False)[:, 0]
    for motion, (name, unit) in zip(panels, kinds, strict=True):
        columns = [i for i, variable in enumerate(study.read) if (variable[1], study.units[i]) == (name, unit)]
        for i, colour in zip(columns, cycle((BLUE, ORANGE, GREEN, *MORE_COLOURS)), strict=False):
            motion.plot(study.time, study.x[:, i], color=colour, label=study.labels[i])
            motion.plot(study.time, study.truth[:, i], color="black", linestyle=":", linewidth=0.9)
        motion.plot([], [], color="black", linestyle=":", label=study.reference)
        motion.set_ylabel(axis_label(name, unit))
        motion.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    panels[0].set_title(f"coupled, communication step {1e3 * study.steps[-1]:g} ms")
    panels[-1].set_xlabel("t [s]")
    plot_error(right.subplots(), study)


def plot_error(axes: Axes, study: Convergence) -> None:
    """Plot the largest error over the communication step."""
    h, errors = np.array(study.steps[: len(study.errors)]), np.array(study.errors)
    if errors.any():
        axes.loglog(h, errors, "o-", color=ORANGE, label="largest error")
        axes.loglog(h, errors[0] * h / h[0], color=GREY, linestyle="--", label="order 1")
        axes.set_xticks(h, [f"{1e3 * step:g}" for step in h])
        axes.xaxis.minorticks_off()
        axes.legend()
    order = "" if isnan(study.order) else f" (order {study.order:.2f})"
    axes.set_title(f"error against the {study.reference}{order}")
    axes.set_xlabel("communication step [ms]")
    axes.set_ylabel(axis_label("error", study.unit))
