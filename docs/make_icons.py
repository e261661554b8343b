"""Draw the icons of the models in fmus/more: `python docs/make_icons.py [NAME...]`."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyBboxPatch
from PIL import Image

MORE = Path(__file__).parents[1] / "fmus" / "more"
COLOURS = 128  # of an icon; half the size of true colours, without a visible difference
INK, RED, BLUE, FILL = "#1b1f24", "#d81f2d", "#1f6feb", "#9ec5f8"
STYLE: dict[str, Any] = {"lw": 4.5, "solid_capstyle": "round", "solid_joinstyle": "round"}


def block(axes: Axes, x: float, y: float, width: float, height: float) -> None:
    """Draw a block with its lower left corner at (x, y)."""
    shape = FancyBboxPatch((x + 8, y + 8), width - 16, height - 16, "round,pad=8", fc=FILL, ec=INK, lw=4.5)
    axes.add_patch(shape)


def spring(axes: Axes, x: float, end: float, y: float) -> None:
    """Draw a spring along a horizontal line."""
    turns = np.linspace(x + 0.15 * (end - x), end - 0.15 * (end - x), 9)
    heights = y + 16 * np.array([0, 1, -1, 1, -1, 1, -1, 1, 0])
    axes.plot([x, *turns, end], [y, *heights, y], color=INK, **STYLE)


def ground(axes: Axes, y: float, x: float = 10, end: float = 246, rough: tuple[float, float] = (20, 110)) -> None:
    """Draw the ground, red where it rubs."""
    axes.plot([x, end], [y, y], color=INK, **STYLE)
    for left in np.arange(rough[0], rough[1], 16):
        axes.plot([left, left - 14], [y - 7, y - 27], color=RED, **STYLE)


def arrow(axes: Axes, x: float, y: float, end: float) -> None:
    """Draw a horizontal arrow."""
    axes.annotate("", (end, y), (x, y), arrowprops={"arrowstyle": "-|>,head_width=0.5", "color": BLUE, "lw": 4.5})


def curve(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw a red curve."""
    axes.plot(x, y, color=RED, **STYLE)


def wall(axes: Axes, x: float, y: float) -> None:
    """Draw a wall at the left end of a spring."""
    axes.plot([x, x], [y - 30, y + 30], color=INK, **STYLE)


def belt(axes: Axes) -> None:
    """Draw a block on a belt."""
    wall(axes, 20, 160)
    spring(axes, 20, 110, 160)
    block(axes, 112, 116, 84, 84)
    for x in (56, 200):
        axes.add_patch(Circle((x, 66), 34, fc="white", ec=INK, lw=4.5))
    axes.plot([56, 200], [103, 103], color=RED, **STYLE)
    axes.plot([56, 200], [29, 29], color=INK, **STYLE)
    arrow(axes, 96, 66, 160)


def lugre(axes: Axes) -> None:
    """Draw bristles between a block and the ground."""
    block(axes, 50, 150, 150, 70)
    for x in np.arange(66, 200, 28):
        axes.plot([x, x + 16], [146, 104], color=RED, **STYLE)
        axes.plot([x, x + 16], [62, 104], color=INK, **STYLE)
    ground(axes, 60, rough=(0, 0))
    arrow(axes, 204, 186, 246)


def elastoplastic(axes: Axes) -> None:
    """Draw force over displacement: elastic, then plastic, and the way back."""
    axes.plot([30, 30], [30, 230], color=INK, **STYLE)
    axes.plot([30, 240], [60, 60], color=INK, **STYLE)
    x = np.linspace(0, 1, 60)
    curve(axes, 30 + 150 * x, 60 + 140 * np.tanh(2.6 * x))
    axes.plot([180, 222], [199, 62], color=BLUE, ls=(0, (1.5, 2.0)), **STYLE | {"solid_capstyle": "butt"})


def sleds(axes: Axes) -> None:
    """Draw two sleds in a row."""
    ground(axes, 70, rough=(20, 170))
    block(axes, 12, 74, 62, 62)
    spring(axes, 76, 122, 106)
    block(axes, 124, 74, 62, 62)
    spring(axes, 188, 232, 106)
    wall(axes, 232, 106)
    curve(axes, np.array([20, 90, 96, 160, 166, 230]), np.array([180, 180, 200, 200, 220, 220]))


def stacked(axes: Axes) -> None:
    """Draw a block on a block."""
    ground(axes, 62, rough=(30, 190))
    block(axes, 24, 66, 160, 66)
    block(axes, 64, 140, 80, 66)
    axes.plot([64, 144], [136, 136], color=RED, **STYLE)
    spring(axes, 146, 216, 174)
    wall(axes, 216, 174)


def forced(axes: Axes) -> None:
    """Draw a mass on a spring under a harmonic force."""
    ground(axes, 62, rough=(96, 190))
    wall(axes, 20, 106)
    spring(axes, 20, 94, 106)
    block(axes, 96, 66, 84, 84)
    arrow(axes, 184, 106, 246)
    x = np.linspace(0, 1, 90)
    curve(axes, 20 + 216 * x, 204 + 26 * np.sin(4 * np.pi * x))


def clutch(axes: Axes) -> None:
    """Draw two inertias and the discs between them."""
    for x, width in ((30, 40), (186, 40)):
        block(axes, x, 60, width, 136)
    axes.plot([72, 112], [128, 128], color=INK, **STYLE)
    axes.plot([144, 184], [128, 128], color=INK, **STYLE)
    for x, colour in ((114, INK), (128, RED), (142, INK)):
        axes.plot([x, x], [78, 178], color=colour, **STYLE)


def joint(axes: Axes) -> None:
    """Draw a motor, a gear and an arm."""
    block(axes, 12, 60, 76, 76)
    axes.plot([90, 112], [98, 98], color=INK, **STYLE)
    axes.add_patch(Circle((140, 98), 28, fc="white", ec=INK, lw=4.5))
    axes.add_patch(Circle((140, 98), 9, fc=RED, ec=RED))
    axes.plot([154, 226], [122, 206], color=INK, **STYLE | {"lw": 12})
    axes.add_patch(Circle((226, 206), 16, fc=FILL, ec=INK, lw=4.5))
    ground(axes, 56, rough=(24, 100))


def servo(axes: Axes) -> None:
    """Draw a slide on a screw, and its friction over speed by points."""
    block(axes, 12, 44, 56, 56)
    axes.plot([70, 244], [72, 72], color=INK, **STYLE)
    block(axes, 132, 40, 70, 64)
    axes.plot([30, 30], [124, 240], color=INK, **STYLE)
    axes.plot([30, 240], [124, 124], color=INK, **STYLE)
    x, y = np.array([30, 52, 84, 130, 182, 232]), np.array([226, 184, 158, 160, 178, 204])
    curve(axes, x, y)
    for point in zip(x, y, strict=True):
        axes.add_patch(Circle(point, 7, fc=RED, ec=RED))


def puck(axes: Axes) -> None:
    """Draw a disc on a tilted plate, and its path to rest."""
    axes.plot([16, 70, 240, 186, 16], [52, 204, 204, 52, 52], color=INK, **STYLE)
    t = np.linspace(0, 1, 60)
    curve(axes, 64 + 120 * t, 120 + 62 * t - 98 * t * t)
    axes.add_patch(Circle((64, 120), 20, fc=FILL, ec=INK, lw=4.5))
    axes.add_patch(Circle((184, 84), 7, fc=RED, ec=RED))


ICONS: dict[str, Callable[[Axes], None]] = {
    drawing.__name__: drawing
    for drawing in (belt, lugre, elastoplastic, sleds, stacked, forced, clutch, joint, servo, puck)
}


def main() -> None:
    """Draw the icons named in the arguments, or all."""
    for name in sys.argv[1:] or ICONS:
        figure = plt.figure(figsize=(2.56, 2.56), dpi=100)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(0, 256), ylim=(0, 256))
        axes.axis("off")
        ICONS[name](axes)
        path = MORE / f"{name}.png"
        figure.savefig(path)
        plt.close(figure)
        with Image.open(path) as picture:
            icon = picture.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, 8, dither=Image.Dither.NONE)
        icon.save(path, optimize=True)


if __name__ == "__main__":
    main()
