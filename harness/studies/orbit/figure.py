"""Figures of periodic motions: the bifurcation diagram, and the phase plane."""

from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any

from ...results.style import BLUE, GREEN, GREY, HEIGHT, LEGEND_ABOVE, ORANGE, WIDTH, Axes, Figure, axis_label, set_size
from ...simulation.motion import AT_REST, SLIDING_ORBIT, STEADY, STICK_SLIP, Motion

if TYPE_CHECKING:
    from .result import OrbitResult

COLOURS = {AT_REST: GREY, STEADY: "#000000", STICK_SLIP: BLUE, SLIDING_ORBIT: ORANGE}


def draw(result: "OrbitResult", figure: Figure) -> None:
    """Draw the diagram over the parameter, with its special points beside it, or the phase plane."""
    if not result.motions:
        return
    set_size(figure, WIDTH + 2.0 * bool(result.points), 1.4 * HEIGHT)
    axes = figure.add_subplot()
    if result.parameter:
        plot_diagram(axes, result)
        lines = [f"{number}  {point.value:.9g}\n    {point.kind}" for number, point in enumerate(result.points, 1)]
        axes.text(1.02, 0.5, "\n".join(lines), transform=axes.transAxes, va="center", fontsize=8)
    else:
        plot_phase_plane(axes, result)


def plot_diagram(axes: Axes, result: "OrbitResult") -> None:
    """Plot the largest coordinate of all motions over the parameter; a line joins neighbouring values with orbits."""
    values = [[*group] for _, group in groupby(result.motions, lambda motion: motion.value)]
    for lower, upper in pairwise([rank(motions) for motions in values] if len(values) > 1 else []):
        for key in lower.keys() & upper.keys():
            pair = lower[key], upper[key]
            axes.plot([motion.value for motion in pair], [motion.largest for motion in pair], **line_style(*key[:2]))
    for ranked_motions in map(rank, values):
        for key, motion in ranked_motions.items():
            axes.plot([motion.value], [motion.largest], ".", color=COLOURS[key[0]], markersize=2)
    for number, point in enumerate(result.points, 1):
        axes.plot([point.value], [point.largest], "o", color=GREEN, markersize=5)
        axes.annotate(str(number), (point.value, point.largest), (4, 4), textcoords="offset points", fontsize=8)
    for kind, stability in dict.fromkeys((motion.kind, motion.stability) for motion in result.motions):
        axes.plot([], [], label=" ".join(filter(None, (kind, stability))), **line_style(kind, stability))
    axes.set_xlabel(axis_label(result.parameter, result.unit))
    axes.set_ylabel(axis_label(f"largest {result.coordinate}", result.coordinate_unit))
    axes.legend(**LEGEND_ABOVE, ncols=2)


def rank(motions: list[Motion]) -> dict[tuple[str, str, int], Motion]:
    """Return motions of one value by kind, stability and their order among these."""
    ranked_motions: dict[tuple[str, str, int], Motion] = {}
    for motion in motions:
        count = sum(key[:2] == (motion.kind, motion.stability) for key in ranked_motions)
        ranked_motions[motion.kind, motion.stability, count] = motion
    return ranked_motions


def line_style(kind: str, stability: str) -> dict[str, Any]:
    """Return the style of a line: unstable motions are dashed."""
    return {"color": COLOURS[kind], "linestyle": "--" if stability == "unstable" else "-"}


def plot_phase_plane(axes: Axes, result: "OrbitResult") -> None:
    """Plot the rate over the coordinate of all motions, with the points at which they return."""
    for motion, path in zip(result.motions, result.paths, strict=True):
        label, style = (
            " ".join(filter(None, (motion.kind, motion.stability))),
            line_style(motion.kind, motion.stability),
        )
        marker = "o" if len(path) == 1 else ""
        axes.plot(path[:, 1], path[:, 2], label=label, marker=marker, markersize=4, **style)
        if len(path) > 1:
            axes.plot(*path[path[:, 3] > 0.0, 1:3].T, "s", color=style["color"], markersize=4)
    axes.set_xlabel(axis_label(result.coordinate, result.coordinate_unit))
    axes.set_ylabel(axis_label(f"d {result.coordinate} / dt", f"{result.coordinate_unit}/s"))
    axes.legend(**LEGEND_ABOVE, ncols=2)
