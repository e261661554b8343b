"""Figure of all rivals: error over processor time, one panel for each scene."""

from pathlib import Path
from typing import Any

from matplotlib.lines import Line2D

from harness.results.style import BLUE, GREEN, GREY, ORANGE, WIDTH, open_figure

from .catalogue import OWN_RIVAL, Rival
from .comparison import Comparison
from .scenes import SCENES, Scene

FLOOR = 1e-16  # smaller errors are drawn at this value
COLOURS = ("#000000", BLUE, ORANGE, GREEN, "#56B4E9", "#0a5c8a", "#CC79A7", "#E69F00", "#8c564b", GREY)
MARKERS = "*os^<>DvPX"


def draw(comparison: Comparison, path: Path) -> None:
    """Save the figure: an open marker for the defaults of a rival, a full one for its best setting."""
    styles: dict[str, dict[str, Any]] = {
        rival.title: {"color": colour, "marker": marker}
        for rival, colour, marker in zip(comparison.rivals, COLOURS, MARKERS, strict=False)
    }
    with open_figure(path, 2 * WIDTH, 6.6) as figure:
        figure.suptitle("Error over processor time: lower left is better; open: default setting, full: best setting")
        panels = figure.subplots(2, 3, squeeze=False, sharex=True)
        for axes, scene in zip(panels.flat, SCENES.values(), strict=True):
            for rival in comparison.rivals:
                plot_rival(axes, comparison, rival, scene, styles[rival.title])
            axes.set(xscale="log", yscale="log", ylim=(0.3 * FLOOR, 3.0))
            axes.minorticks_off()
            axes.set_title(f"{scene.title}, {scene.stop:g} s")
            axes.set_ylabel(f"largest error [{scene.unit}]")
        for axes in panels[-1]:
            axes.set_xlabel(f"processor time over that of {OWN_RIVAL.title}")
        handles = [Line2D([], [], linestyle="", label=title, **style) for title, style in styles.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False)


def plot_rival(axes: Any, comparison: Comparison, rival: Rival, scene: Scene, style: dict[str, Any]) -> None:
    """Plot the settings of a rival in a scene, joined by a line."""
    results = [result for result in comparison.of_scene(scene) if result.rival == rival.title]
    results.sort(key=lambda result: list(rival.settings).index(result.setting))
    points = [(comparison.time_ratio(r), max(r.measures.error, FLOOR)) for r in results if r.measures]
    if points:
        axes.plot(*zip(*points, strict=True), color=style["color"], linewidth=0.8, alpha=0.6)
    for point, result in zip(points, results, strict=True):
        face = style["color"] if result.setting == "best" else "none"
        axes.plot(*point, linestyle="", markersize=9 if rival is OWN_RIVAL else 6, markerfacecolor=face, **style)
