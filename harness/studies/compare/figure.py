"""Figure of a comparison: both sides of each variable on the left, their difference on the right."""

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
    Figure,
    axis_label,
    format_unit,
    mask_undrawable,
    set_size,
)
from .study import Comparison, Difference, is_string

MAX_VARIABLES = 8  # the variables with the largest relative differences are drawn
ROUNDING = 64 * np.finfo(float).eps


def draw(comparison: Comparison, figure: Figure) -> None:
    """Draw the figure; without numeric variables it is empty."""
    variables = select_variables(comparison)
    if not variables:
        return
    set_size(figure, 2 * WIDTH, 0.8 + 0.9 * HEIGHT * len(variables))
    figure.suptitle(f"{comparison.one.name} and {comparison.two.name}", fontsize=11)
    panels = figure.subplots(len(variables), 2, sharex=True, squeeze=False)
    for (values_axes, difference_axes), variable in zip(panels, variables, strict=True):
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
        plot_difference(difference_axes, comparison, variable)
    panels[0, 0].legend(**LEGEND_ABOVE, ncols=2)
    for axes in panels[-1]:
        axes.set_xlabel("t [s]")
        axes.set_xlim(np.min(comparison.time), np.max(comparison.time))


def select_variables(comparison: Comparison) -> list[Difference]:
    """Return the numeric variables to draw, the largest relative difference first."""
    numbers = [variable for variable in comparison.differences if not is_string(comparison.one, variable.name)]
    return sorted(numbers, key=lambda variable: -variable.relative)[:MAX_VARIABLES]


def plot_difference(axes: Axes, comparison: Comparison, variable: Difference) -> None:
    """Plot the difference of a variable."""
    unit, size = display_unit(variable.unit)
    left, right = (mask_undrawable(values) / size for values in (variable.left, variable.right))
    axes.plot(comparison.time, left - right, color=GREEN, linewidth=0.8)
    widen_axis(axes, np.nanmax(np.abs([left, right]), initial=0.0))
    largest, rms = variable.largest / size, variable.rms / size
    axes.set_title(f"difference: largest {largest:.3g}, rms {rms:.3g} {format_unit(unit)}")
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
    axes.axvline(variable.at, color=GREY, linestyle=":", linewidth=0.8)


def widen_axis(axes: Axes, largest: float) -> None:
    """Widen the y axis of a difference that varies only by rounding of values up to `largest`."""
    low, high = axes.get_ylim()
    if high - low < ROUNDING * largest:
        reach = max(ROUNDING * largest, 2 * abs(low), 2 * abs(high))
        axes.set_ylim(-reach, reach)
