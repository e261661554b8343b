"""The figure of a coupled scene: its motion beside the reference, and the error over the communication step."""

from pathlib import Path

import numpy as np

from ...results.style import BLUE, GREEN, GREY, HEIGHT, ORANGE, WIDTH, label, sheet
from .convergence import Convergence


def draw(found: Convergence, path: Path) -> None:
    """Save the figure."""
    with sheet(path, 2 * WIDTH, 1.6 * HEIGHT) as figure:
        figure.suptitle(found.title, fontsize=11)
        motion, error = figure.subplots(1, 2, width_ratios=(3, 2))
        colours = 9 * (BLUE, GREEN, "#CC79A7")
        for text, x, truth, colour in zip(found.labels, found.x.T, found.truth.T, colours, strict=False):
            motion.plot(found.time, x, color=colour, label=text)
            motion.plot(found.time, truth, color="black", linestyle=":", linewidth=0.9)
        motion.plot([], [], color="black", linestyle=":", label=found.reference)
        motion.set_title(f"coupled, communication step {1e3 * found.steps[-1]:g} ms")
        motion.set_xlabel("t [s]")
        motion.set_ylabel(label(found.read[0][1] if found.unit else "", found.unit))
        motion.legend()
        h, errors = np.array(found.steps[: len(found.errors)]), np.array(found.errors)
        if errors.any():
            error.loglog(h, errors, "o-", color=ORANGE, label="largest error")
            error.loglog(h, errors[0] * h / h[0], color=GREY, linestyle="--", label="in proportion to the step")
            error.set_xticks(h, [f"{1e3 * step:g}" for step in h])
            error.minorticks_off()
            error.legend()
        error.set_title(f"error against the {found.reference} (order {found.order:.2f})")
        error.set_xlabel("communication step [ms]")
        error.set_ylabel(label("error", found.unit))
