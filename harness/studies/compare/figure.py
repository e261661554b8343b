"""The figure of a comparison: each variable of both above, their difference below."""

from pathlib import Path

import numpy as np

from ...results.quantity import display_unit
from ...results.style import (
    BLUE,
    GREEN,
    GREY,
    HEIGHT,
    LEGEND_ABOVE,
    ORANGE,
    WIDTH,
    Axes,
    axis_label,
    format_unit,
    mask_undrawable,
    open_figure,
)
from . import units
from .difference import Comparison, textual

MOST = 8  # variables drawn, those that differ most
ROUNDING = 64 * np.finfo(float).eps


def draw(found: Comparison, path: Path) -> None:
    """Save the figure, if there is anything but texts to draw."""
    numbers = [each for each in found.differences if not textual(found.one, each.name)]
    chosen = sorted(numbers, key=lambda each: -each.relative)[:MOST]
    if not chosen:
        return
    with open_figure(path, 2 * WIDTH, 0.8 + 0.9 * HEIGHT * len(chosen)) as figure:
        figure.suptitle(f"{found.one.name} and {found.two.name}", fontsize=11)
        panels = figure.subplots(len(chosen), 2, sharex=True, squeeze=False)
        for (both, off), each in zip(panels, chosen, strict=True):
            unit, size = display_unit(each.unit)
            for side, style in ((found.one, {"color": BLUE}), (found.two, {"color": ORANGE, "linestyle": "--"})):
                values = mask_undrawable(side.columns[each.name]) * (
                    units.conversion_factor(side.units[each.name], each.unit) or 1.0
                )
                both.plot(side.time, values / size, label=f"{side.name} ", **style)
            both.set_ylabel(axis_label(each.name, unit))
            left, right = (mask_undrawable(values) / size for values in (each.left, each.right))
            off.plot(found.time, left - right, color=GREEN, linewidth=0.8)
            resolved(off, np.nanmax(np.abs([left, right]), initial=0.0))
            largest, rms = each.largest / size, each.rms / size
            off.set_title(f"difference: largest {largest:.3g}, rms {rms:.3g} {format_unit(unit)}")
            off.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
            off.axvline(each.at, color=GREY, linestyle=":", linewidth=0.8)
        panels[0, 0].legend(**LEGEND_ABOVE, ncols=2)
        for axes in panels[-1]:
            axes.set_xlabel("t [s]")
            axes.set_xlim(np.min(found.time), np.max(found.time))


def resolved(axes: Axes, largest: float) -> None:
    """Show a difference that is constant but for what rounding leaves of values up to `largest` as constant."""
    low, high = axes.get_ylim()
    if high - low < ROUNDING * largest:
        reach = max(ROUNDING * largest, 2 * abs(low), 2 * abs(high))
        axes.set_ylim(-reach, reach)
