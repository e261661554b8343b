"""Stability figure: internal steps over stiffness for every method."""

from collections.abc import Iterable
from pathlib import Path

from ...results.style import HEIGHT, METHOD_COLOURS, WIDTH, open_figure
from .outcomes import StabilityRegion


def draw(regions: Iterable[StabilityRegion], path: Path) -> None:
    """Save the figure; a slope of -1 means that steps are bounded by stability."""
    with open_figure(path, 1.3 * WIDTH, 2 * HEIGHT) as figure:
        axes = figure.subplots()
        for region in regions:
            text = f"{region.method}: {region.slope:+.2f}"
            axes.loglog(
                region.stiffness,
                region.steps,
                color=METHOD_COLOURS[region.method],
                marker="o",
                markersize=4,
                label=text,
            )
        axes.set_title("pacejka, 16 s at rtol 1e-6: internal steps over x_m, the speed of maximum friction")
        axes.set_xlabel("x_m [m/s]")
        axes.set_ylabel("internal steps")
        axes.invert_xaxis()  # stiffer to the right
        axes.legend(title="slope at the stiff end")
