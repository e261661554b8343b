"""Figure of a fit: records and fits, residuals of each law, fitted lookup tables, and profiles of the parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...analyses.estimation.estimate import ColumnResiduals, Estimate
from ...analyses.estimation.figure import plot_legend, plot_record, plot_residuals
from ...analyses.fit.parameter_fit import FittedRecord, ParameterFit, Profile
from ...results.quantity import display_unit
from ...results.style import GREEN, GREY, HEIGHT, ORANGE, WIDTH, Axes, Figure, axis_label, set_size
from ...simulation.model_data import LookupTable
from ...simulation.plot import draw_table

MAX_COLUMNS, MAX_PROFILES = 6, 12  # drawn at most
COLOURS = (ORANGE, GREEN, "#CC79A7", "#56B4E9")  # of the laws
RECORD, RESIDUALS, PROFILES, TABLE = 2.0, 1.0, 1.3, 2.0  # relative heights of the panels
PROFILES_IN_ROW = 4
HIGHEST_EXCESS = 2.0  # of a profile, in units of the limit of the 95 % interval


@dataclass(frozen=True)
class FittedColumn:
    """A column of a record, the prediction of each law for it, and the title of its panel."""

    column: ColumnResiduals
    record: FittedRecord
    position: int
    signals: tuple[np.ndarray, ...]
    title: str


def draw(fit: ParameterFit, figure: Figure) -> None:
    """Draw the figure."""
    laws = (fit, *fit.against)
    columns = fitted_columns(laws)[:MAX_COLUMNS]
    profiles = [(n, profile) for n, law in enumerate(laws) for profile in law.profiles][:MAX_PROFILES]
    in_row = min(len(profiles), PROFILES_IN_ROW)
    rows = -(-len(profiles) // PROFILES_IN_ROW)
    heights = [RECORD, *[RESIDUALS] * len(laws)] * len(columns)
    tables = [(n, law, table) for n, law in enumerate(laws) for table in law.tables]
    parts = {"records": sum(heights), "tables": TABLE * len(tables), "profiles": PROFILES * rows}
    parts = {name: height for name, height in parts.items() if height}
    set_size(figure, 1.8 * WIDTH, 0.53 * HEIGHT * sum(parts.values()))
    grid = figure.add_gridspec(len(parts), 1, height_ratios=list(parts.values()))
    areas = {name: figure.add_subfigure(grid[i]) for i, name in enumerate(parts)}
    axes = areas["records"].subplots(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    for n, column in enumerate(columns):
        plot_column(axes[n * (len(laws) + 1) :][: len(laws) + 1], laws, column)
    axes[-1].set_xlabel("t [s]")
    if rows:
        panels = areas["profiles"].subplots(rows, in_row, sharey=True, squeeze=False)
        for panel, (n, profile) in zip(panels.flat, profiles, strict=False):
            plot_profile(panel, profile, laws[n][profile.name], COLOURS[n % len(COLOURS)])
            panel.set_title(f"profile: {laws[n].fmu}" if len(laws) > 1 else "profile")
        for panel in panels.flat[len(profiles) :]:
            panel.set_axis_off()
        for panel in panels[:, 0]:
            panel.set_ylabel("rise of squares\n(1: 95 %)")
    if tables:
        curves = areas["tables"].subplots(len(tables), 1, squeeze=False)[:, 0]
        for axes, (n, law, table) in zip(curves, tables, strict=True):
            plot_table(axes, law, table, COLOURS[n % len(COLOURS)])


def fitted_columns(laws: Sequence[ParameterFit]) -> list[FittedColumn]:
    """Return the columns of the fitted records, then those of the validation records."""
    parts = [(laws[0].columns, laws[0].records, [law.predictions for law in laws], "")]
    if validation := laws[0].validation:
        signals = [law.validation.predictions for law in laws if law.validation]
        parts.append((validation.columns, validation.records, signals, ", for validation: not fitted"))
    drawn_columns = []
    for columns, records, predictions, text in parts:
        for n, column in enumerate(columns):
            i, j = divmod(n, predictions[0][0].shape[1])
            signals_of_laws = tuple(prediction[i][:, j] for prediction in predictions)
            drawn_columns.append(FittedColumn(column, records[i], j, signals_of_laws, f"{column.record}{text}"))
    return drawn_columns


def plot_column(panels: np.ndarray, laws: Sequence[ParameterFit], fitted_column: FittedColumn) -> None:
    """Plot a column of a record with the fits, and below it the residuals of each law."""
    plot_fits(panels[0], laws, fitted_column)
    record, j = fitted_column.record, fitted_column.position
    unit, size = display_unit(fitted_column.column.unit)
    samples = record.y[:, j] / size
    for law, signal, axes in zip(laws, fitted_column.signals, panels[1:], strict=True):
        name = f" of {law.fmu}" if len(laws) > 1 else ""
        plot_residuals(axes, record.t, samples - signal / size, float(record.noise[j]) / size, name, unit)
        axes.sharex(panels[0])
    limits = [axes.get_ylim() for axes in panels[1:]]
    for axes in panels[1:]:
        axes.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))


def plot_fits(axes: Axes, laws: Sequence[ParameterFit], fitted_column: FittedColumn) -> None:
    """Plot a column of a record with the fits."""
    unit, size = display_unit(fitted_column.column.unit)
    samples = fitted_column.record.y[:, fitted_column.position] / size
    plot_record(axes, fitted_column.record.t, samples, fitted_column.title, axis_label(fitted_column.column.name, unit))
    for n, (law, signal) in enumerate(zip(laws, fitted_column.signals, strict=True)):
        colour = COLOURS[n % len(COLOURS)]
        axes.plot(fitted_column.record.t, signal / size, color=colour, linewidth=0.9, label=f"fit: {law.fmu}")
    plot_legend(axes)


def plot_table(axes: Axes, fit: ParameterFit, table: LookupTable, colour: str) -> None:
    """Plot a lookup table with fitted values and their 95 % intervals, and the curve at the start of the fit."""
    estimates = {estimate.name: estimate for estimate in fit.estimates}
    draw_table(axes, table, table.y, GREY, "start")
    y = table.y_with({name: estimate.value for name, estimate in estimates.items()})
    draw_table(axes, table, y, colour, f"fit: {fit.fmu}")
    for x, name in zip(table.x, table.parameters, strict=True):
        if name in estimates and isfinite(estimates[name].low) and isfinite(estimates[name].high):
            axes.plot([x, x], [estimates[name].low, estimates[name].high], "_-", color=colour)
    plot_legend(axes)


def plot_profile(axes: Axes, profile: Profile, estimate: Estimate, colour: str) -> None:
    """Plot a profile; the 95 % interval ends where it reaches 1.

    Between its points, the root of the squares is interpolated, which is nearly linear.
    """
    unit, size = display_unit(estimate.unit)
    value, excess = np.array(profile.value) / size, np.array(profile.excess)
    root = np.sqrt(excess) * np.sign(value - estimate.value / size)
    if len(value) > 1:
        grid = np.linspace(value[0], value[-1], 200)
        axes.plot(grid, PchipInterpolator(value, root)(grid) ** 2, color=colour, linewidth=0.9)
    axes.plot(value, excess, ".", markersize=4, color=colour)
    axes.axhline(1.0, color="black", linewidth=0.6)
    if isfinite(estimate.low) and isfinite(estimate.high):
        axes.axvspan(estimate.low / size, estimate.high / size, color=GREY, alpha=0.2, linewidth=0)
    axes.set_ylim(0.0, HIGHEST_EXCESS)
    axes.locator_params(axis="x", nbins=3)
    axes.set_xlabel(axis_label(profile.name, unit))
