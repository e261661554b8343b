"""The figure of stability: internal steps over the stiffness, for every method."""

from collections.abc import Iterable
from pathlib import Path

from ...results.style import HEIGHT, METHOD_COLOURS, WIDTH, open_figure
from .outcomes import StabilityRegion


def draw(regions: Iterable[StabilityRegion], path: Path) -> None:
    """Save the steps of each method; a line of slope -1 is bounded by stability."""
    with open_figure(path, 1.3 * WIDTH, 2 * HEIGHT) as figure:
        axes = figure.subplots()
        for each in regions:
            text = f"{each.method}: {each.slope:+.2f}"
            axes.loglog(
                each.stiffness, each.steps, color=METHOD_COLOURS[each.method], marker="o", markersize=4, label=text
            )
        axes.set_title("pacejka, 16 s at rtol 1e-6: steps over the speed at the peak of the friction curve")
        axes.set_xlabel("x_m [m/s]")
        axes.set_ylabel("internal steps")
        axes.invert_xaxis()  # stiffer to the right
        axes.legend(title="slope at the stiff end")
