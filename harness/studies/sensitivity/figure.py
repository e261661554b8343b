"""Figure of derivatives: an output and its derivatives by each parameter over time, with shaded sticking."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...results.quantity import display_unit, divide_units
from ...results.style import BLUE, GREY, HEIGHT, ORANGE, WIDTH, Axes, Figure, axis_label, mask_undrawable, set_size

if TYPE_CHECKING:
    from .result import SensitivityResult


def draw(result: "SensitivityResult", figure: Figure, outputs: Sequence[str]) -> None:
    """Draw a column of panels for each output."""
    rows = 1 + len(result.parameters)
    set_size(figure, WIDTH * len(outputs), 0.5 + 0.75 * HEIGHT * rows)
    panels = figure.subplots(rows, len(outputs), sharex=True, squeeze=False)
    figure.suptitle(result.title, fontsize=11)
    for column, output in zip(panels.T, outputs, strict=True):
        unit, size = display_unit(result.units[output])
        plot_curve(column[0], result, result[output] / size, BLUE)
        column[0].set_ylabel(axis_label(output, unit))
        for axes, parameter in zip(column[1:], result.parameters, strict=True):
            plot_slope(axes, result, output, parameter)
        column[-1].set_xlabel("t [s]")
        column[-1].set_xlim(result.t[0], result.t[-1])


def plot_slope(axes: Axes, result: "SensitivityResult", output: str, parameter: str) -> None:
    """Plot the derivative of an output by a parameter."""
    plot_curve(axes, result, result[output, parameter], ORANGE)
    unit = divide_units(result.units[output], result.units[parameter])
    axes.set_ylabel(axis_label(f"d {output} / d {parameter}", unit))


def plot_curve(axes: Axes, result: "SensitivityResult", values: np.ndarray, colour: str) -> None:
    """Plot values over time, broken at events; shade the times at which all contacts stick."""
    times = np.array([event.t for event in result.events])
    at = np.searchsorted(result.t, times)
    axes.plot(np.insert(result.t, at, times), np.insert(mask_undrawable(values), at, np.nan), color=colour)
    for begin, end in list_rests(result):
        axes.axvspan(begin, end, color=GREY, alpha=0.15, linewidth=0)


def list_rests(result: "SensitivityResult") -> list[tuple[float, float]]:
    """Return the intervals of time in s in which all contacts stick."""
    if not result.events or not result.events[0].before:
        return []
    edges = [float(result.t[0]), *(event.t for event in result.events), float(result.t[-1])]
    modes = [result.events[0].before, *(event.after for event in result.events)]
    return [(a, b) for a, b, mode in zip(edges[:-1], edges[1:], modes, strict=True) if not any(mode.values())]
