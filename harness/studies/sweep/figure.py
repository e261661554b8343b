"""Figure of a sweep: curves for one parameter, maps for two, scatter plots for more parameters or a random sample.

A lookup table whose values are varied has a panel with its curves. An axis is logarithmic if its values are spaced
logarithmically or span decades. Very many runs are thinned evenly.
"""

import json
from collections.abc import Callable
from functools import partial

import matplotlib
import numpy as np
import xarray
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from ...results.style import BLUE, HEIGHT, WIDTH, Figure, axis_label, is_drawable, set_size
from ...simulation.model_data import LookupTable, parse_table
from ...simulation.plot import draw_table

FAILED_COLOUR = "#bbbbbb"
LOG_RATIO = 100.0  # ratio of largest to smallest value from which an axis is logarithmic
MAX_POINTS = 20_000  # runs drawn in curves and scatter plots
MAX_CELLS = 300  # cells along each side of a map
MAX_CURVES = 20  # drawn of a lookup table


def thin_out(dataset: xarray.Dataset) -> xarray.Dataset:
    """Return the measures of at most as many runs as are drawn, without values that are too large for an axis."""
    measures = dataset.drop_vars("error", errors="ignore")
    n_axes = len(measures.dims)
    limit = MAX_CELLS if n_axes == 2 else int(MAX_POINTS ** (1 / n_axes))
    thin = measures.isel({name: slice(None, None, -(-size // limit)) for name, size in measures.sizes.items()}).load()
    for name in thin.coords:
        (dimension,) = thin[name].dims
        thin = thin.isel({dimension: np.flatnonzero(is_drawable(thin[name]))})
    return thin.where(is_drawable)


def draw(data: xarray.Dataset, figure: Figure, n_failed: int) -> None:
    """Draw the figure: panels of the measures, over each parameter in scatter plots, and one of each varied table.

    Without runs, the figure stays empty.
    """
    if not all(data.sizes.values()):
        return
    measures, parameters = [str(name) for name in data.data_vars], [str(name) for name in data.coords]
    is_scatter, tables = is_scattered(data), tables_of(data)
    draw_panel: list[Callable[[Axes], None]]
    if is_scatter:
        n_columns = len(parameters)
        draw_panel = [
            partial(plot_scatter, data=data, measure=measure, name=name) for measure in measures for name in parameters
        ]
    else:
        n_columns = 1 if len(measures) == 1 and not tables else 2
        draw_panel = [partial(draw_measure, data=data, measure=measure) for measure in measures]
    draw_panel += [partial(draw_curves, data=data, table=table) for table in tables]
    n_rows = -(-len(draw_panel) // n_columns)
    height = HEIGHT * (1.2 if is_scatter or len(parameters) == 1 else 1.7)
    set_size(figure, max(1.2, n_columns) * WIDTH, height * n_rows + 0.6)
    figure.suptitle(f"{data.attrs['title']}{f' ({n_failed} runs failed)' if n_failed else ''}", fontsize=11)
    panels = figure.subplots(n_rows, n_columns, squeeze=False).flat
    for axes, draw_on in zip(panels, draw_panel, strict=False):
        draw_on(axes)
    for axes in panels[len(draw_panel) :]:
        axes.remove()
    legend: dict[str, Artist] = {}
    for axes in figure.axes:
        legend |= {text: artist for artist, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    if legend:
        figure.legend(handles=list(legend.values()), labels=list(legend), loc="outside lower center", ncols=2)


def tables_of(data: xarray.Dataset) -> list[LookupTable]:
    """Return the lookup tables with varied values."""
    return [parse_table(table) for table in json.loads(data.attrs.get("tables", "[]"))]


def draw_curves(axes: Axes, data: xarray.Dataset, table: LookupTable) -> None:
    """Draw the curves of a lookup table, evenly chosen from all combinations of its varied values."""
    names = [name for name in dict.fromkeys(table.parameters) if name in data.coords]
    columns = [data[name].to_numpy() for name in names]
    combinations = np.unique(
        np.column_stack(columns if "run" in data.dims else [grid.ravel() for grid in np.meshgrid(*columns)]), axis=0
    )
    indices = np.unique(np.linspace(0, len(combinations) - 1, MAX_CURVES).round().astype(int))
    colours = matplotlib.colormaps["viridis"](np.linspace(0, 0.9, len(indices)))
    for n, colour in zip(indices, colours, strict=True):
        label = None
        if len(names) == 1 and n in (0, len(combinations) - 1):
            label = f"{table.name} with {names[0]} = {combinations[n, 0]:g} {data[names[0]].attrs['units']}"
        draw_table(axes, table, table.y_with(dict(zip(names, combinations[n], strict=True))), colour, label)
    if len(indices) < len(combinations):
        axes.set_title(f"table {table.name}: {len(indices)} of {len(combinations)} curves")


def is_scattered(data: xarray.Dataset) -> bool:
    """Return whether a sweep is drawn as points: a sample, or a grid of more than two parameters."""
    return "run" in data.dims or len(data.coords) > 2


def draw_measure(axes: Axes, data: xarray.Dataset, measure: str) -> None:
    """Draw one measure over the first parameter, or over both."""
    if is_scattered(data):
        plot_scatter(axes, data, measure, str(next(iter(data.coords))))
    else:
        (plot_curve if len(data.coords) == 1 else draw_map)(axes, data, measure)


def label_axes(axes: Axes, data: xarray.Dataset, x_name: str, y_name: str) -> None:
    """Set labels and scales of the axes."""
    axes.set(
        xscale=axis_scale(data, x_name),
        yscale=axis_scale(data, y_name),
        xlabel=label_with_unit(data, x_name),
        ylabel=label_with_unit(data, y_name),
    )


def label_with_unit(data: xarray.Dataset, name: str) -> str:
    """Return a name with its unit."""
    unit = data[name].attrs["units"]
    return axis_label(name, "" if unit == "1" else unit)


def axis_scale(data: xarray.Dataset, name: str) -> str:
    """Return the scale for a parameter or measure: linear or log."""
    values = data[name].to_numpy()
    values = values[np.isfinite(values)]
    decades = len(values) and values.min() > 0 and values.max() >= LOG_RATIO * values.min()
    return "log" if decades or data[name].attrs.get("scale") == "log" else "linear"


def plot_curve(axes: Axes, data: xarray.Dataset, measure: str) -> None:
    """Plot a measure over one parameter; failed runs are gaps."""
    (name,) = map(str, data.dims)
    axes.plot(data[name], data[measure], color=BLUE, marker="." if data.sizes[name] < 100 else None)
    label_axes(axes, data, name, measure)
    axes.set_title(data[measure].attrs["long_name"])


def draw_map(axes: Axes, data: xarray.Dataset, measure: str) -> None:
    """Plot a measure over two parameters; failed runs are grey."""
    x_name, y_name = map(str, data.dims)
    axes.set_facecolor(FAILED_COLOUR)
    image = axes.pcolormesh(
        *(data[name].to_numpy() for name in (x_name, y_name)),
        data[measure].to_numpy().T,
        shading="nearest",
        cmap="viridis",
        norm=axis_scale(data, measure),
    )
    axes.figure.colorbar(image, ax=axes, label=label_with_unit(data, measure))
    label_axes(axes, data, x_name, y_name)
    axes.grid(visible=False)
    axes.set_title(data[measure].attrs["long_name"])


def plot_scatter(axes: Axes, data: xarray.Dataset, measure: str, name: str) -> None:
    """Plot a measure over one parameter, with one point per run."""
    positions = data[name].broadcast_like(data[measure]).to_numpy()
    axes.plot(positions.ravel(), data[measure].to_numpy().ravel(), ".", color=BLUE, markersize=3, alpha=0.6)
    label_axes(axes, data, name, measure)
