"""Draws the icons: python -m fmus.packaging.icons"""

from collections.abc import Callable
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

from ..catalogue import FMUS

PIXELS = 256
INK, BODY, FRICTION, MOTION = "#1b1f24", "#9cc4f5", "#d1242f", "#1f6feb"
LINE: dict[str, Any] = {"color": INK, "linewidth": 5, "solid_capstyle": "round", "solid_joinstyle": "round"}


def canvas() -> tuple[Figure, Axes]:
    """An empty square of side 10."""
    figure = Figure(figsize=(PIXELS / 100, PIXELS / 100), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 10), ylim=(0, 10), aspect="equal")
    axes.axis("off")
    return figure, axes


def spring(axes: Axes, left: float, right: float, y: float) -> None:
    """A zigzag."""
    turns = np.linspace(left + 0.4, right - 0.4, 9)
    heights = y + np.array([0, 0.7, -0.7, 0.7, -0.7, 0.7, -0.7, 0.7, 0])
    axes.plot([left, *turns, right], [y, *heights, y], **LINE)


def damper(axes: Axes, left: float, right: float, y: float) -> None:
    """A piston in a cup."""
    middle = 0.5 * (left + right)
    axes.plot([left, middle - 0.3], [y, y], **LINE)
    axes.plot([middle + 0.9, middle - 0.3, middle - 0.3, middle + 0.9], [y + 0.8, y + 0.8, y - 0.8, y - 0.8], **LINE)
    axes.plot([middle + 0.3, middle + 0.3], [y - 0.5, y + 0.5], **LINE)
    axes.plot([middle + 0.3, right], [y, y], **LINE)


def wall(axes: Axes, x: float, low: float, high: float, ground: bool = True) -> None:
    """A wall, and the ground to its right."""
    axes.plot([x, x], [low, high], **LINE)
    if ground:
        axes.plot([x, 9.6], [low, low], **LINE)


def mass(axes: Axes, left: float, bottom: float, width: float = 3.2, height: float = 3.4) -> None:
    """A block."""
    body = FancyBboxPatch((left, bottom), width, height, boxstyle="round,pad=0,rounding_size=0.4")
    body.set(facecolor=BODY, edgecolor=INK, linewidth=5)
    axes.add_patch(body)


def rubbing(axes: Axes, left: float, right: float, y: float) -> None:
    """Hatching where friction acts."""
    for x in np.linspace(left, right, 7):
        axes.plot([x, x - 0.6], [y, y - 0.9], color=FRICTION, linewidth=5, solid_capstyle="round")


def arrow(axes: Axes, tail: tuple[float, float], head: tuple[float, float]) -> None:
    """An arrow of motion."""
    style = {"arrowstyle": "-|>,head_width=0.45,head_length=0.8", "color": MOTION, "linewidth": 6}
    axes.annotate("", head, tail, arrowprops=style)


def smd(axes: Axes) -> None:
    wall(axes, 0.9, 1.6, 8.4)
    spring(axes, 0.9, 5.8, 5.6)
    damper(axes, 0.9, 5.8, 3.2)
    mass(axes, 5.8, 1.9, height=5)


def coulomb(axes: Axes) -> None:
    wall(axes, 0.9, 2.4, 8.4)
    spring(axes, 0.9, 5.6, 4.6)
    mass(axes, 5.6, 2.6, height=4)
    rubbing(axes, 5.9, 9.1, 2.2)


def sled(axes: Axes) -> None:
    axes.plot([0.4, 9.6], [2.4, 2.4], **LINE)
    mass(axes, 0.8, 2.6, height=3.2)
    spring(axes, 4.0, 7.4, 4.2)
    axes.plot([7.4, 7.4], [3.2, 5.2], **LINE)
    arrow(axes, (7.2, 4.2), (9.8, 4.2))


def stickslip(axes: Axes) -> None:
    sled(axes)
    rubbing(axes, 1.1, 4.1, 2.2)
    t = np.array([0.6, 3.2, 3.5, 6.1, 6.4, 9.0, 9.4])
    axes.plot(t, [6.7, 6.7, 7.8, 7.8, 8.9, 8.9, 9.6], color=FRICTION, linewidth=5, solid_joinstyle="round")


def pacejka(axes: Axes) -> None:
    sled(axes)
    v = np.linspace(0, 1, 60)
    curve = np.sin(1.9 * np.arctan(14 * v)) * 2.6 + 6.6
    axes.plot(0.6 + 8.6 * v, curve, color=FRICTION, linewidth=6, solid_capstyle="round")


def pendulum(axes: Axes) -> None:
    axes.plot([2.6, 7.4], [9.2, 9.2], **LINE)
    bob = (7.2, 2.4)
    axes.plot([5, bob[0]], [8.0, bob[1]], **(LINE | {"linewidth": 9}))
    axes.add_patch(Circle(bob, 1.6, facecolor=BODY, edgecolor=INK, linewidth=5))
    axes.add_patch(Circle((5, 8.0), 0.9, facecolor="white", edgecolor=FRICTION, linewidth=6))
    turn = np.radians(np.linspace(-112, -82, 30))
    axes.plot(5 + 6.6 * np.cos(turn) - 0.4, 8 + 6.6 * np.sin(turn), color=MOTION, linewidth=5, linestyle=(0, (1.5, 1)))


DRAWINGS: tuple[Callable[[Axes], None], ...] = (smd, coulomb, stickslip, pacejka, pendulum)


def main() -> None:
    """Write `<model>.png` beside the file of each model."""
    for drawing in DRAWINGS:
        figure, axes = canvas()
        drawing(axes)
        figure.savefig(FMUS / f"{drawing.__name__}.png", metadata={"Software": None})


if __name__ == "__main__":
    main()
