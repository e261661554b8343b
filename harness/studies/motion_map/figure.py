"""Figure of a map: its regions, with their edges as curves."""

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ...results.style import BLUE, GREEN, GREY, LEGEND_ABOVE, ORANGE, Axes, axis_label

if TYPE_CHECKING:
    from .result import MapResult

COLOURS = (BLUE, ORANGE, GREEN, "#CC79A7", "#E69F00", "#56B4E9", GREY)
STRAIGHT = 1.5  # cells of the grid: points of an edge that are farther apart are not joined


def plot_map(axes: Axes, result: "MapResult") -> None:
    """Mark the points of the grid by what motions end in, and join the points of each edge."""
    points = np.array([point[::-1] for point in product(*result.axes[::-1])])
    flat = np.column_stack([points, np.zeros(len(points))])[:, :2]
    labels = np.array(result.labels)
    for colour, label in zip(COLOURS * len(labels), dict.fromkeys(result.labels), strict=False):
        axes.plot(*flat[labels == label].T, "s", color=colour, alpha=0.35, markersize=3, label=label)
    cells = np.array([np.ptp(axis) / (len(axis) - 1) for axis in result.axes] + [0.0])[:2]
    for name in dict.fromkeys(edge.name for edge in result.edges):
        edge = np.array([(*item.point, 0.0)[:2] for item in result.edges if item.name == name])
        style = "-|k" if len(result.axes) == 1 else ".-k"
        axes.plot(*join_points(edge, cells).T, style, linewidth=1.2, markersize=6 if len(result.axes) == 1 else 2)
    units = [*result.units.items(), ("", "")]
    axes.set_xlabel(axis_label(*units[0]))
    if len(result.axes) == 1:
        axes.set_yticks([])
    else:
        axes.set_ylabel(axis_label(*units[1]))
    axes.legend(**LEGEND_ABOVE, ncols=2)


def join_points(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return points (n, 2) in the order of a walk from an end to the nearest one; a row of NaN where that is far."""
    scaled_points = points / np.where(cells > 0.0, cells, 1.0)
    indices, order = {*range(len(points))}, [int(np.argmax(np.hypot(*(scaled_points - scaled_points.mean(axis=0)).T)))]
    indices.remove(order[0])
    walk = [points[order[0]]]
    while indices:
        nearest = min(indices, key=lambda i: float(np.hypot(*(scaled_points[i] - scaled_points[order[-1]]))))
        if np.hypot(*(scaled_points[nearest] - scaled_points[order[-1]])) > STRAIGHT:
            walk.append(np.full(2, np.nan))
        walk.append(points[nearest])
        order.append(nearest)
        indices.remove(nearest)
    return np.array(walk)
