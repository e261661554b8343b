"""The figure of a coupled scene: positions beside the reference, and the error over the communication step."""

from pathlib import Path

import numpy as np

from ...results.style import BLUE, GREEN, GREY, HEIGHT, ORANGE, WIDTH, sheet
from .convergence import Convergence


def draw(found: Convergence, path: Path) -> None:
    """Save the figure as PNG."""
    with sheet(path, 2 * WIDTH, 1.6 * HEIGHT) as figure:
        figure.suptitle(found.scene.title, fontsize=11)
        motion, error = figure.subplots(1, 2, width_ratios=(3, 2))
        for part, x, truth, color in zip(
            found.scene.parts, found.x.T, found.truth.T, 9 * (BLUE, GREEN, "#CC79A7"), strict=False
        ):
            motion.plot(found.time, x, color=color, label=f"{part.name} ({part.model})")
            motion.plot(found.time, truth, color="black", linestyle=":", linewidth=0.9)
        motion.plot([], [], color="black", linestyle=":", label="monolithic reference")
        motion.set_title(f"coupled, communication step {1e3 * found.steps[-1]:g} ms")
        motion.set_xlabel("t [s]")
        motion.set_ylabel("x [m]")
        motion.legend()
        h = np.array(found.steps)
        error.loglog(h, found.errors, "o-", color=ORANGE, label="largest error of a position")
        error.loglog(h, found.errors[0] * h / h[0], color=GREY, linestyle="--", label="in proportion to the step")
        error.set_title(f"error against the reference (order {found.order:.2f})")
        error.set_xticks(h, [f"{1e3 * step:g}" for step in h])
        error.minorticks_off()
        error.set_xlabel("communication step [ms]")
        error.set_ylabel("error [m]")
        error.legend()
