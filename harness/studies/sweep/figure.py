"""The figure of a sweep: curves for one parameter, maps for two, points for a sample or for more.

An axis is logarithmic where its values were spread so or lie over decades.  Of very many runs only some are drawn,
evenly among them.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from ...results.style import BLUE, GREEN, HEIGHT, ORANGE, WIDTH, axis_label, open_figure
from .boundaries import Boundary

FAILED = "#bbbbbb"
COLOURS = (ORANGE, "#CC79A7", GREEN)  # of known boundaries
HATCHES = ("//", "\\\\", "..")  # of the side below
DECADES = 100.0  # the largest value over the smallest from which on an axis is logarithmic
MOST = 20_000  # runs that are drawn as curves and points
CELLS = 300  # along each side of a map
FINE = 401  # points along an axis where a boundary is looked for


def draw(file: Path, path: Path, boundaries: Sequence[Boundary], failed: int) -> None:
    """Save the figure of a sweep's netCDF file: a panel for each measure, in points for each measure and
    parameter."""
    with xarray.open_dataset(file, engine="scipy", drop_variables="error") as whole:
        many = len(whole.dims)
        most = CELLS if many == 2 else int(MOST ** (1 / many))
        data = whole.isel({name: slice(None, None, -(-size // most)) for name, size in whole.sizes.items()}).load()
    measures, varied = [str(name) for name in data.data_vars], [str(name) for name in data.coords]
    scattered = "run" in data.dims or len(varied) > 2
    across = len(varied) if scattered else min(len(measures), 2)
    down = len(measures) if scattered else -(-len(measures) // 2)
    height = HEIGHT * (1.2 if scattered or len(varied) == 1 else 1.7)
    with open_figure(path, max(1.2, across) * WIDTH, height * down + 0.6) as figure:
        figure.suptitle(f"{data.attrs['title']}{f' ({failed} runs failed)' if failed else ''}", fontsize=11)
        panels = figure.subplots(down, across, squeeze=False)
        if scattered:
            for row, measure in zip(panels, measures, strict=True):
                for axes, name in zip(row, varied, strict=True):
                    plot_scatter(axes, data, measure, name)
        else:
            for axes, measure in zip(panels.flat, measures, strict=False):
                (plot_curve if len(varied) == 1 else draw_map)(axes, data, measure, boundaries)
            for axes in panels.flat[len(measures) :]:
                axes.remove()
        shown: dict[str, Artist] = {}
        for axes in figure.axes:
            shown |= {text: drawn for drawn, text in zip(*axes.get_legend_handles_labels(), strict=True)}
        if shown:
            figure.legend(handles=list(shown.values()), labels=list(shown), loc="outside lower center", ncols=2)


def label_axes(axes: Axes, data: xarray.Dataset, across: str, up: str) -> None:
    """Name what the axes show, and spread it as it is spread."""
    axes.set(
        xscale=axis_scale(data, across),
        yscale=axis_scale(data, up),
        xlabel=label_with_unit(data, across),
        ylabel=label_with_unit(data, up),
    )


def label_with_unit(data: xarray.Dataset, name: str) -> str:
    """A name with its unit."""
    unit = data[name].attrs["units"]
    return axis_label(name, "" if unit == "1" else unit)


def axis_scale(data: xarray.Dataset, name: str) -> str:
    """The kind of axis for the values of a parameter or measure: linear or log."""
    values = data[name].to_numpy()
    values = values[np.isfinite(values)]
    decades = len(values) and values.min() > 0 and values.max() >= DECADES * values.min()
    return "log" if decades or data[name].attrs.get("scale") == "log" else "linear"


def sampled_range(data: xarray.Dataset, name: str) -> np.ndarray:
    """Many values over the range of a parameter."""
    low, high = float(data[name].min()), float(data[name].max())
    return np.geomspace(low, high, FINE) if axis_scale(data, name) == "log" else np.linspace(low, high, FINE)


def plot_curve(axes: Axes, data: xarray.Dataset, measure: str, boundaries: Sequence[Boundary]) -> None:
    """A measure over the one parameter; a failed run is a gap."""
    (name,) = map(str, data.dims)
    axes.plot(data[name], data[measure], color=BLUE, marker="." if data.sizes[name] < 100 else None)
    label_axes(axes, data, name, measure)
    fine = sampled_range(data, name)
    for each, color in zip(boundaries, COLOURS, strict=False):
        below = quantity(each, data, {name: fine}) < 1
        for at in fine[1:][np.diff(below)]:
            axes.axvline(at, color=color, linestyle="--", label=each.text)
        if below.any() and not below.all():
            shade = axes.fill_between(fine, 0, 1, below, transform=axes.get_xaxis_transform(), label=each.below)
            shade.set(color=color, alpha=0.15)
    axes.set_title(data[measure].attrs["long_name"])


def draw_map(axes: Axes, data: xarray.Dataset, measure: str, boundaries: Sequence[Boundary]) -> None:
    """A measure over two parameters, the first to the right; failed runs are grey, known boundaries are dashed, and the
    side below is hatched."""
    across, up = map(str, data.dims)
    axes.set_facecolor(FAILED)
    image = axes.pcolormesh(
        *(data[name].to_numpy() for name in (across, up)),
        data[measure].to_numpy().T,
        shading="nearest",
        cmap="viridis",
        norm=axis_scale(data, measure),
    )
    axes.figure.colorbar(image, ax=axes, label=label_with_unit(data, measure))
    plane = dict(zip((across, up), np.meshgrid(sampled_range(data, across), sampled_range(data, up)), strict=True))
    for each, color, hatch in zip(boundaries, COLOURS, HATCHES, strict=False):
        found = quantity(each, data, plane)
        if np.nanmin(found) < 1 < np.nanmax(found):
            axes.contour(*plane.values(), found, levels=[1.0], colors=color, linestyles="--")
            shade = axes.contourf(*plane.values(), found, levels=[-np.inf, 1.0], colors="none", hatches=[hatch])
            shade.set_edgecolor(color)
            axes.plot([], [], color=color, linestyle="--", label=each.text)
            axes.fill([], [], facecolor="none", edgecolor=color, hatch=hatch, linewidth=0, label=each.below)
    label_axes(axes, data, across, up)
    axes.grid(visible=False)
    axes.set_title(data[measure].attrs["long_name"])


def plot_scatter(axes: Axes, data: xarray.Dataset, measure: str, name: str) -> None:
    """A measure over one of the parameters, every run a point."""
    where = data[name].broadcast_like(data[measure]).to_numpy()
    axes.plot(where.ravel(), data[measure].to_numpy().ravel(), ".", color=BLUE, markersize=3, alpha=0.6)
    label_axes(axes, data, name, measure)


def quantity(boundary: Boundary, data: xarray.Dataset, varied: dict[str, np.ndarray]) -> np.ndarray:
    """That of a boundary, where the varied parameters are these, of one shape."""
    (shape,) = {each.shape for each in varied.values()}
    held = json.loads(data.attrs["parameters"])
    return np.broadcast_to(boundary.evaluate(held | varied, float(data.attrs["stop_time"])), shape)
