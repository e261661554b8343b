"""Figure of a comparison: both sides of each variable on the left, their difference on the right."""

from pathlib import Path

import numpy as np

from ...records.units import conversion_factor
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
from .difference import Comparison, is_string

MAX_VARIABLES = 8  # the variables with the largest relative differences are drawn
ROUNDING = 64 * np.finfo(float).eps


def draw(comparison: Comparison, path: Path) -> None:
    """Save the figure; without numeric variables there is none."""
    numbers = [variable for variable in comparison.differences if not is_string(comparison.one, variable.name)]
    selected = sorted(numbers, key=lambda variable: -variable.relative)[:MAX_VARIABLES]
    if not selected:
        return
    with open_figure(path, 2 * WIDTH, 0.8 + 0.9 * HEIGHT * len(selected)) as figure:
        figure.suptitle(f"{comparison.one.name} and {comparison.two.name}", fontsize=11)
        panels = figure.subplots(len(selected), 2, sharex=True, squeeze=False)
        for (values_axes, difference_axes), variable in zip(panels, selected, strict=True):
            unit, size = display_unit(variable.unit)
            for side, style in (
                (comparison.one, {"color": BLUE}),
                (comparison.two, {"color": ORANGE, "linestyle": "--"}),
            ):
                values = mask_undrawable(side.columns[variable.name]) * (
                    conversion_factor(side.units[variable.name], variable.unit) or 1.0
                )
                values_axes.plot(side.time, values / size, label=f"{side.name} ", **style)
            values_axes.set_ylabel(axis_label(variable.name, unit))
            left, right = (mask_undrawable(values) / size for values in (variable.left, variable.right))
            difference_axes.plot(comparison.time, left - right, color=GREEN, linewidth=0.8)
            widen_axis(difference_axes, np.nanmax(np.abs([left, right]), initial=0.0))
            largest, rms = variable.largest / size, variable.rms / size
            difference_axes.set_title(f"difference: largest {largest:.3g}, rms {rms:.3g} {format_unit(unit)}")
            difference_axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
            difference_axes.axvline(variable.at, color=GREY, linestyle=":", linewidth=0.8)
        panels[0, 0].legend(**LEGEND_ABOVE, ncols=2)
        for axes in panels[-1]:
            axes.set_xlabel("t [s]")
            axes.set_xlim(np.min(comparison.time), np.max(comparison.time))


def widen_axis(axes: Axes, largest: float) -> None:
    """Widen the y axis of a difference that varies only by rounding of values up to `largest`."""
    low, high = axes.get_ylim()
    if high - low < ROUNDING * largest:
        reach = max(ROUNDING * largest, 2 * abs(low), 2 * abs(high))
        axes.set_ylim(-reach, reach)
