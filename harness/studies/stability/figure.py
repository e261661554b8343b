"""Stability figure: internal steps over stiffness for every method."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from ...results.style import HEIGHT, METHOD_COLOURS, WIDTH, Axes, Figure, set_size

if TYPE_CHECKING:
    from .result import StabilityRegion


def draw(regions: Iterable["StabilityRegion"], figure: Figure) -> None:
    """Draw the figure."""
    set_size(figure, 1.3 * WIDTH, 2 * HEIGHT)
    plot_steps(figure.subplots(), regions)


def plot_steps(axes: Axes, regions: Iterable["StabilityRegion"]) -> None:
    """Plot internal steps over stiffness; a slope of -1 means that steps are bounded by stability."""
    for region in regions:
        axes.loglog(
            region.stiffness,
            region.steps,
            color=METHOD_COLOURS[region.method],
            marker="o",
            markersize=4,
            label=f"{region.method}: {region.slope:+.2f}",
        )
    axes.set_title("pacejka, 16 s at rtol 1e-6: internal steps over x_m, the speed of maximum friction")
    axes.set_xlabel("x_m [m/s]")
    axes.set_ylabel("internal steps")
    axes.invert_xaxis()  # stiffer to the right
    axes.legend(title="slope at the stiff end")
