"""The figure of a sweep: curves for one parameter, maps for two, points for a sample or for more."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes

from ...results.style import BLUE, GREEN, HEIGHT, ORANGE, WIDTH, label, sheet
from .boundaries import known

FAILED = "#bbbbbb"
LINES = (ORANGE, "#CC79A7", GREEN)  # of known boundaries


def draw(data: xarray.Dataset, path: Path) -> None:
    """Save the figure as PNG: a panel for each measure, in points for each measure and parameter."""
    measures = [str(name) for name in data.data_vars if name != "error"]
    varied = [str(name) for name in data.coords]
    grid = "run" not in data.dims
    across = len(varied) if not grid or len(varied) > 2 else min(len(measures), 2)
    down = len(measures) if not grid or len(varied) > 2 else -(-len(measures) // 2)
    height = HEIGHT * (1.7 if grid and len(varied) == 2 else 1.2)
    with sheet(path, max(1.2, across) * WIDTH, height * down + 0.6) as figure:
        failed = int((data["error"] != "").sum())
        figure.suptitle(f"{data.attrs['title']}{f' ({failed} runs failed)' if failed else ''}", fontsize=11)
        panels = figure.subplots(down, across, squeeze=False)
        if not grid or len(varied) > 2:
            for row, measure in zip(panels, measures, strict=True):
                for axes, name in zip(row, varied, strict=True):
                    scatter(axes, data, measure, name)
        else:
            for axes, measure in zip(panels.flat, measures, strict=False):
                (curve if len(varied) == 1 else chart)(axes, data, measure)
            for axes in panels.flat[len(measures) :]:
                axes.remove()
        lines = {line.get_label(): line for axes in figure.axes for line in axes.lines if line.get_linestyle() == "--"}
        if lines:
            figure.legend(list(lines.values()), list(map(str, lines)), loc="outside lower center", ncols=1)


def words(data: xarray.Dataset, name: str) -> str:
    """A name with its unit."""
    unit = data[name].attrs["units"]
    return label(name, "" if unit == "1" else unit)


def scale(data: xarray.Dataset, name: str) -> str:
    """The kind of axis a parameter was spread on: linear or log."""
    return str(data[name].attrs["scale"])


def curve(axes: Axes, data: xarray.Dataset, measure: str) -> None:
    """A measure over the one parameter; a failed run is a gap."""
    (name,) = map(str, data.dims)
    axes.plot(data[name], data[measure], color=BLUE, marker="." if data.sizes[name] < 100 else None)
    axes.set_xscale(scale(data, name))
    fine = np.linspace(float(data[name].min()), float(data[name].max()), 2001)
    for each, color in zip(known(data.attrs["model"], (name,)), LINES, strict=False):
        quantity = np.broadcast_to(each.quantity(parameters(data) | {name: fine}, stop(data)), fine.shape)
        for at in fine[1:][np.diff(np.sign(quantity - 1)) != 0]:
            axes.axvline(at, color=color, linestyle="--", label=each.text)
    axes.set_title(data[measure].attrs["long_name"])
    axes.set_xlabel(words(data, name))
    axes.set_ylabel(words(data, measure))


def chart(axes: Axes, data: xarray.Dataset, measure: str) -> None:
    """A measure over two parameters, the first to the right; failed runs are grey, the known boundary is dashed."""
    across, up = map(str, data.dims)
    x, y = data[across].to_numpy(), data[up].to_numpy()
    axes.set_facecolor(FAILED)
    image = axes.pcolormesh(x, y, data[measure].to_numpy().T, shading="nearest", cmap="viridis")
    axes.figure.colorbar(image, ax=axes, label=words(data, measure))
    edges = axes.get_xlim(), axes.get_ylim()
    plane = dict(zip((across, up), np.meshgrid(np.linspace(*edges[0], 401), np.linspace(*edges[1], 401)), strict=True))
    for each, color in zip(known(data.attrs["model"], (across, up)), LINES, strict=False):
        quantity = np.broadcast_to(each.quantity(parameters(data) | plane, stop(data)), plane[up].shape)
        if np.min(quantity) < 1 < np.max(quantity):
            axes.contour(plane[across], plane[up], quantity, levels=[1.0], colors=color, linestyles="--")
            axes.plot([], [], color=color, linestyle="--", label=each.text)
    axes.set(xscale=scale(data, across), yscale=scale(data, up), xlim=edges[0], ylim=edges[1])
    axes.grid(visible=False)
    axes.set_title(data[measure].attrs["long_name"])
    axes.set_xlabel(words(data, across))
    axes.set_ylabel(words(data, up))


def scatter(axes: Axes, data: xarray.Dataset, measure: str, name: str) -> None:
    """A measure over one of the parameters, every run a point."""
    where = data[name].broadcast_like(data[measure]).to_numpy()
    axes.plot(where.ravel(), data[measure].to_numpy().ravel(), ".", color=BLUE, markersize=3, alpha=0.6)
    axes.set_xscale(scale(data, name))
    axes.set_xlabel(words(data, name))
    axes.set_ylabel(words(data, measure))


def parameters(data: xarray.Dataset) -> dict[str, Any]:
    """The parameters that were not varied."""
    return json.loads(data.attrs["parameters"])


def stop(data: xarray.Dataset) -> float:
    return float(data.attrs["stop_time"])
