"""The figure of an identified decay: signal and fit, residuals, and what each half swing loses."""

from pathlib import Path
from typing import Any

import numpy as np

from ...analyses.decay.energy_loss import EnergyLoss
from ...analyses.decay.identification import DecayIdentification
from ...analyses.decay.law import Terms
from ...results.quantity import display_unit
from ...results.style import BLUE, GREEN, GREY, HEIGHT, ORANGE, WIDTH, Axes, axis_label, open_figure

MARGINS = {"left": 0.105, "right": 0.985, "bottom": 0.055, "top": 0.97, "hspace": 0.35}
MAX_POINTS = 4000  # points of a line: more are not seen
COLOURS: dict[Terms, str] = {("zeta",): GREEN, ("r",): BLUE, ("b",): "#CC79A7"}  # of the laws of one term


def draw(found: DecayIdentification, loss: EnergyLoss, path: Path) -> None:
    """Save the figure."""
    with open_figure(path, 1.8 * WIDTH, 3.4 * HEIGHT, layout=None) as figure:
        grid = figure.add_gridspec(3, 1, height_ratios=(3, 1.2, 2.2), **MARGINS)
        above = figure.add_subplot(grid[0])
        below = figure.add_subplot(grid[1], sharex=above)
        signal(above, found)
        residuals(below, found)
        shares(figure.add_subplot(grid[2]), found, loss)


def signal(axes: Axes, found: DecayIdentification) -> None:
    """Record, fit, rest position, turning points, and what was left out."""
    record, t = found.record, found.t
    unit, size = display_unit(record.unit)
    used = np.isin(record.t - found.problem.time_origin, found.problem.t)
    points(axes, t, found.x / size, color=BLUE, label="record")
    if not used.all():
        points(axes, record.t[~used], record.x[~used] / size, color=GREY, label="left out")
    fine = np.linspace(t[0], t[-1], MAX_POINTS) if len(t) < MAX_POINTS else t[extremes(found.x)]
    axes.plot(
        fine, found.signal(found.best, fine) / size, color=ORANGE, linewidth=0.9, label=f"fit: {found.best.description}"
    )
    rest = found.rest(found.best, fine[[0, -1]]) / size
    axes.plot(fine[[0, -1]], rest, color=GREY, linestyle="--", linewidth=0.8, label="rest")
    if not record.order:
        style: dict[str, Any] = {"color": "black", "fillstyle": "none", "markersize": 5}
        axes.plot(found.extrema.t, found.extrema.x / size, "o", label="turning points", **style)
    axes.set_title(f"{record.name}: {found.best.description}")
    axes.set_ylabel(axis_label(("x", "v", "a")[record.order], unit))
    axes.legend(loc="upper right", ncols=3)


def points(axes: Axes, t: np.ndarray, x: np.ndarray, **style: Any) -> None:
    """Samples, or of many those that show how far they reach."""
    some = extremes(x)
    axes.plot(t[some], x[some], ".", markersize=2.5, **style)


def extremes(x: np.ndarray) -> np.ndarray:
    """All samples of x (n,), or of many the first, the lowest and the highest of each of MOST/2 stretches: what is left
    out lies between those, whatever its period."""
    if len(x) <= MAX_POINTS:
        return np.arange(len(x))
    size = -(-2 * len(x) // MAX_POINTS)
    places = np.minimum(np.arange(0, len(x), size)[:, None] + np.arange(size), len(x) - 1)
    low, high = x[places].argmin(axis=1), x[places].argmax(axis=1)
    return np.unique(places[:, 0] + [np.zeros_like(low), low, high])


def residuals(axes: Axes, found: DecayIdentification) -> None:
    """Record less fit."""
    unit, size = display_unit(found.record.unit)
    left = (found.x - found.signal(found.best, found.t)) / size
    points(axes, found.t, left, color=BLUE)
    axes.axhline(0, color="black", linewidth=0.6)
    axes.set_title(f"residuals (rms {found.rms / size:.3g} {unit})")
    axes.set_ylabel(axis_label("record - fit", unit))
    axes.set_xlabel("t [s]")


def shares(axes: Axes, found: DecayIdentification, loss: EnergyLoss) -> None:
    """The share of its energy that each half swing loses, with the curves of all laws."""
    best, others = found.best, found.laws[1:]
    unit, size = display_unit(found.record.base)

    def curve(loss: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes, and shares in percent."""
        return loss[0] / size, 100 * loss[1]

    for law in (law for law in others if law.terms in COLOURS):
        axes.plot(*curve(loss.curves[law.terms]), color=COLOURS[law.terms], linestyle="--", label=law.description)
    for i, law in enumerate(law for law in others if law.terms not in COLOURS):
        label_once = "" if i else "other mixed laws"
        axes.plot(*curve(loss.curves[law.terms]), color=GREY, linestyle=":", label=label_once)
    axes.plot(*curve(loss.curves[best.terms]), color=ORANGE, linewidth=2, label=f"fit: {best.description}")
    if len(loss.amplitude):
        axes.plot(*curve((loss.amplitude, loss.fraction)), "o", color="black", fillstyle="none", label="turning points")
    drawn = np.concatenate([loss.fraction, loss.curves[best.terms][1]])
    if len(drawn):
        low, high = np.percentile(100 * drawn, [5, 95])
        margin = 0.4 * (high - low) + 0.1 * abs(high) + 1e-9
        axes.set_ylim(min(low - margin, 0.0), high + margin)
    axes.set_title("energy lost in a half swing, against its amplitude")
    axes.set_ylabel("share of the energy [%]")
    axes.set_xlabel(axis_label("amplitude", unit))
    axes.legend(loc="best", ncols=2)
