"""Figure of an identified decay: signal and fit, residuals, and energy loss per half cycle."""

from typing import Any

import numpy as np

from ...analyses.decay.identification import DecayIdentification
from ...analyses.decay.law import Terms
from ...analyses.estimation.figure import MAX_POINTS, extremes, plot_legend, plot_record, plot_residuals, plot_samples
from ...results.quantity import display_unit
from ...results.style import BLUE, GREEN, GREY, HEIGHT, ORANGE, WIDTH, Axes, Figure, axis_label, set_size

MARGINS = {"left": 0.105, "right": 0.985, "bottom": 0.055, "top": 0.97, "hspace": 0.35}
COLOURS: dict[Terms, str] = {("zeta",): GREEN, ("r",): BLUE, ("b",): "#CC79A7"}  # colours of the laws with one term


def draw(identification: DecayIdentification, figure: Figure) -> None:
    """Draw the figure."""
    set_size(figure, 1.8 * WIDTH, 3.4 * HEIGHT, layout=None)
    grid = figure.add_gridspec(3, 1, height_ratios=(3, 1.2, 2.2), **MARGINS)
    signal_axes = figure.add_subplot(grid[0])
    residual_axes = figure.add_subplot(grid[1], sharex=signal_axes)
    plot_signal(signal_axes, identification)
    unit, size = display_unit(identification.record.unit)
    residuals = (identification.x - identification.fit_values) / size
    noise = identification.problem.noise * identification.problem.scale / size
    plot_residuals(residual_axes, identification.t, residuals, noise, "", unit)
    residual_axes.set_xlabel("t [s]")
    plot_energy_loss(figure.add_subplot(grid[2]), identification)


def plot_signal(axes: Axes, identification: DecayIdentification) -> None:
    """Plot record, fit, rest position, turning points, and excluded samples."""
    record, t = identification.record, identification.t
    unit, size = display_unit(record.unit)
    is_fitted = np.isin(record.t - identification.problem.time_origin, identification.problem.t)
    plot_record(axes, t, identification.x / size, record.name, axis_label(record.symbol, unit))
    if not is_fitted.all():
        plot_samples(axes, record.t[~is_fitted], record.x[~is_fitted] / size, color=GREY, label="excluded")
    times = np.linspace(t[0], t[-1], MAX_POINTS) if len(t) < MAX_POINTS else t[extremes(identification.x)]
    axes.plot(
        times,
        identification.signal(identification.best, times) / size,
        color=ORANGE,
        linewidth=0.9,
        label=f"fit: {identification.best.description}",
    )
    rest = identification.rest(identification.best, times[[0, -1]]) / size
    axes.plot(times[[0, -1]], rest, color=GREY, linestyle="--", linewidth=0.8, label="rest")
    if not record.order:
        style: dict[str, Any] = {"color": "black", "fillstyle": "none", "markersize": 5}
        axes.plot(identification.extrema.t, identification.extrema.x / size, "o", label="turning points", **style)
    plot_legend(axes)


def plot_energy_loss(axes: Axes, identification: DecayIdentification) -> None:
    """Plot the relative energy loss per half cycle, with the curves of all laws.

    The legend leaves out what that of the signal explains.
    """
    best, others, loss = identification.best, identification.laws[1:], identification.energy_loss
    unit, size = display_unit(identification.record.base)

    def curve(loss: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return amplitudes and losses in percent."""
        return loss[0] / size, 100 * loss[1]

    for law in (law for law in others if law.terms in COLOURS):
        axes.plot(*curve(loss.curves[law.terms]), color=COLOURS[law.terms], linestyle="--", label=law.description)
    for i, law in enumerate(law for law in others if law.terms not in COLOURS):
        label_once = "" if i else "other combinations"
        axes.plot(*curve(loss.curves[law.terms]), color=GREY, linestyle=":", label=label_once)
    axes.plot(*curve(loss.curves[best.terms]), color=ORANGE, linewidth=2)
    if len(loss.amplitude):
        label = "turning points" if identification.record.order else ""
        axes.plot(*curve((loss.amplitude, loss.fraction)), "o", color="black", fillstyle="none", label=label)
    fractions = np.concatenate([loss.fraction, loss.curves[best.terms][1]])
    if len(fractions):
        low, high = np.percentile(100 * fractions, [5, 95])
        margin = 0.4 * (high - low) + 0.1 * abs(high) + 1e-9
        axes.set_ylim(min(low - margin, 0.0), high + margin)
    axes.set_title("energy loss per half cycle over amplitude")
    axes.set_ylabel("loss, % of the mean energy")
    axes.set_xlabel(axis_label("amplitude", unit))
    axes.legend(loc="best", ncols=2)
