"""Style of all figures: colours, sizes, axis labels."""

import re
import textwrap
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib import artist, rc_context

from .files import column_heading

artist.kwdoc = lambda artist: ""  # skips generating property lists for docstrings, a third of the import time

from matplotlib.axes import Axes as Axes  # noqa: E402
from matplotlib.axis import Axis  # noqa: E402
from matplotlib.collections import QuadMesh  # noqa: E402
from matplotlib.figure import Figure as Figure  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from matplotlib.text import Text  # noqa: E402

# Colours of Okabe and Ito, distinguishable for colour-blind readers.
BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
GREY = "#777777"  # references for comparison
# Methods of a family share a colour.
METHOD_COLOURS = {
    "exact": "#000000",
    **dict.fromkeys(("ode23", "RK23"), BLUE),
    **dict.fromkeys(("ode45", "RK45"), ORANGE),
    **dict.fromkeys(("dop853", "DOP853"), GREEN),
    **dict.fromkeys(("rodas", "radau9", "Radau"), "#CC79A7"),
    "LSODA": "#56B4E9",
    **dict.fromkeys(("Adams", "BDF", "fmpy's CVode"), "#E69F00"),
}
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "lines.linewidth": 1.2,
    "legend.framealpha": 0.9,
    "legend.fontsize": 8,
    "svg.fonttype": "none",  # keep text as text
    "svg.hashsalt": "friction",  # reproducible files
}
DARK = {  # colours for a dark screen
    "#ffffff": "#1d2125",
    "#000000": "#e6e8ea",
    "#dddddd": "#343a40",
    "#cccccc": "#454c54",
    GREY: "#9aa4ae",
    BLUE.lower(): "#4aa8e0",
    ORANGE.lower(): "#f08a4b",
    GREEN.lower(): "#2cc295",
}
DARK_RULES = "".join(
    f'[style*="{part}: {light}"] {{ {part}: {dark} !important }}\n'
    for light, dark in DARK.items()
    for part in ("fill", "stroke")
)
DARK_STYLE = f"@media screen and (prefers-color-scheme: dark) {{\ntext {{ fill: {DARK['#000000']} }}\n{DARK_RULES}}}\n"
MAX_VECTOR_MARKERS = 1000  # more markers are rasterized
LEGEND_ABOVE: dict[str, Any] = {  # legend above its panel, where it hides nothing
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "frameon": False,
    "borderaxespad": 0.2,
    "columnspacing": 1.2,
    "handlelength": 1.4,
}
MAX_DRAWN_VALUE = 1e150  # larger values are not drawn
MAX_TEXT_LENGTH = 500  # characters of a text that are drawn
LINE_BREAKS = re.compile(r"(\s+|(?<=[._\]]))")  # possible line breaks; names of variables have no blanks
UNWRITABLE = re.compile(r"[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # characters that XML does not allow
WIDTH, HEIGHT = 5.5, 2.3  # inches of one column and of one panel
DPI = 130


@contextmanager
def open_figure(
    path: Path, width: float, height: float, layout: Literal["constrained"] | None = "constrained"
) -> Iterator[Figure]:
    """Yield a figure and save it as SVG on exit. The SVG follows the light or dark scheme of the reader's screen.

    Texts are drawn literally. Missing glyphs and numbers that cannot be drawn are left out without a warning.

    Parameters
    ----------
    path : pathlib.Path
        SVG file.
    width, height : float
        Size in inches.
    layout : str or None
        Layout engine; None for fixed margins, which saves drawing everything twice.
    """
    with use_style():
        figure = Figure(figsize=(width, height), dpi=DPI, layout=layout)
        yield figure
        save_figure(figure, path)


@contextmanager
def use_style() -> Iterator[None]:
    """Draw in the style of the project, without warnings on glyphs and numbers that cannot be drawn."""
    with rc_context(STYLE), warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def set_size(
    figure: Figure, width: float, height: float, layout: Literal["constrained"] | None = "constrained"
) -> None:
    """Set the size of a figure in inches, and its layout as in `open_figure`."""
    figure.set_size_inches(width, height)
    figure.set_layout_engine(layout or "none")


def save_figure(figure: Figure, path: Path) -> None:
    """Lay out a figure and save it as SVG."""
    for text in find_texts(figure):
        text.set_parse_math(False)
        text.set_text(UNWRITABLE.sub("\N{REPLACEMENT CHARACTER}", text.get_text()[:MAX_TEXT_LENGTH]))
    for parent, texts in ((figure, figure.texts), *((axes, find_texts(axes)) for axes in figure.axes)):
        extent = parent.get_window_extent()
        for text in texts:
            wrap_text(text, extent.height if text.get_rotation() == 90 else extent.width)
    for axes in figure.axes:
        for dense in filter(is_crowded, (*axes.lines, *axes.collections)):
            dense.set_rasterized(True)
    if engine := figure.get_layout_engine():
        engine.execute(figure)
        figure.set_layout_engine(None)  # otherwise everything is drawn twice
    svg = StringIO()
    figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    svg_text = re.sub(r' d="[^"]*"', lambda line: re.sub(r"(\.\d\d)\d+", r"\1", line[0]), svg.getvalue())
    path.write_text(svg_text.replace("</style>", f"{DARK_STYLE}</style>", 1), encoding="utf-8")


def is_crowded(element: artist.Artist) -> bool:
    """Return whether an artist has so many elements that it should be rasterized."""
    if isinstance(element, Line2D):
        return element.get_marker() not in ("None", None) and np.size(element.get_xdata()) > MAX_VECTOR_MARKERS
    return isinstance(element, QuadMesh)


def find_texts(parent: artist.Artist) -> Iterator[Text]:
    """Yield all texts in a figure except tick labels, where powers are set as mathematics."""
    for child in parent.get_children():
        if isinstance(child, Text):
            yield child
        elif isinstance(child, Axis):
            yield from (child.label, child.offsetText)  # get_children() would create ticks each time
        else:
            yield from find_texts(child)


def wrap_text(text: Text, width: float) -> None:
    """Break a text that is longer than `width` pixels into lines."""
    extent, lines = text.get_window_extent(), text.get_text().splitlines()
    if (longest := max(extent.width, extent.height)) > width:
        wrapper = textwrap.TextWrapper(max(1, int(max(map(len, lines)) * width / longest)))
        wrapper.wordsep_re = LINE_BREAKS
        text.set_text("\n".join(map(wrapper.fill, lines)))


def is_drawable(values: Any) -> Any:
    """Return whether numbers, in an array of numpy or xarray, are small enough for an axis."""
    return abs(values) < MAX_DRAWN_VALUE


def mask_undrawable(y: np.ndarray) -> np.ndarray:
    """Return values (n,) with NaN for those that are too large for an axis."""
    return np.where(is_drawable(y), y, np.nan)


def axis_label(name: str, unit: str) -> str:
    """Return the label of an axis."""
    return column_heading(name, format_unit(unit))


def format_unit(unit: str) -> str:
    """Return a unit as figures show it."""
    return unit.replace("2", "²").replace(".", "·")
