"""The figure of a comparison: each variable of both above, their difference below."""

from pathlib import Path

import numpy as np

from ...results.style import BLUE, GREEN, GREY, HEIGHT, ORANGE, WIDTH, drawable, label, sheet
from .difference import Comparison, textual

MOST = 8  # variables drawn, those that differ most


def draw(found: Comparison, path: Path) -> None:
    """Save the figure, if there is anything but texts to draw."""
    numbers = [each for each in found.differences if not textual(found.one, each.name)]
    chosen = sorted(numbers, key=lambda each: -each.relative)[:MOST]
    if not chosen:
        return
    with sheet(path, 2 * WIDTH, 0.8 + 0.9 * HEIGHT * len(chosen)) as figure:
        figure.suptitle(f"{found.one.name} and {found.two.name}", fontsize=11)
        panels = figure.subplots(len(chosen), 2, sharex=True, squeeze=False)
        for (both, off), each in zip(panels, chosen, strict=True):
            both.plot(found.one.time, drawable(found.one.columns[each.name]), color=BLUE, label=found.one.name)
            both.plot(
                found.two.time,
                drawable(found.two.columns[each.name]),
                color=ORANGE,
                linestyle="--",
                label=f"{found.two.name} ",
            )
            both.set_ylabel(label(each.name, each.unit))
            off.plot(found.time, drawable(each.left) - drawable(each.right), color=GREEN, linewidth=0.8)
            off.set_title(f"difference: largest {each.largest:.3g}, rms {each.rms:.3g} {each.unit}")
            off.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
            off.axvline(each.at, color=GREY, linestyle=":", linewidth=0.8)
        panels[0, 0].legend()
        for axes in panels[-1]:
            axes.set_xlabel("t [s]")
            axes.set_xlim(np.min(found.time), np.max(found.time))
