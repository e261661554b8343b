"""The look of every figure: colours, sizes, headings of axes."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib import artist, rc_context

from .files import heading

artist.kwdoc = lambda artist: ""  # the lists of properties in all docstrings, a third of what is still to be imported

from matplotlib.axes import Axes as Axes  # noqa: E402
from matplotlib.axis import Tick  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.text import Text  # noqa: E402

# Okabe and Ito's colours, which stay apart for colour-blind readers.
BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
GREY = "#777777"  # of what is only there to compare with
# Methods of one family have one colour.
FAMILIES = {
    "exact": "#000000",
    **dict.fromkeys(("ode23", "RK23"), BLUE),
    **dict.fromkeys(("ode45", "RK45"), ORANGE),
    **dict.fromkeys(("dop853", "DOP853"), GREEN),
    **dict.fromkeys(("rodas", "Radau"), "#CC79A7"),
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
}
LARGEST = 1e150  # that is drawn
LONGEST = 500  # letters of a text that are drawn
WIDTH, HEIGHT = 5.5, 2.3  # inches of one column and of one panel


@contextmanager
def sheet(
    path: Path, width: float, height: float, layout: Literal["constrained"] | None = "constrained"
) -> Iterator[Figure]:
    """A figure in this look, of a size in inches; saved as PNG when all has been drawn.  Without a `layout`, which
    draws all of it once more to find the margins, these are given.

    Names and titles are drawn letter by letter, whatever is in them.  What nobody can draw, such as letters that the
    font lacks and numbers near the end of their range, is left out of the picture without a word.
    """
    with rc_context(STYLE), warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        figure = Figure(figsize=(width, height), dpi=130, layout=layout)
        yield figure
        for text in texts(figure):
            text.set_parse_math(False)
            text.set_text(text.get_text()[:LONGEST].encode("utf-8", "replace").decode())  # a path may be no text
        figure.savefig(path)


def texts(within: artist.Artist) -> Iterator[Text]:
    """All texts in a figure but the numbers at its axes, where powers are set as mathematics."""
    for child in within.get_children():
        if isinstance(child, Text):
            yield child
        elif not isinstance(child, Tick):
            yield from texts(child)


def drawable(y: np.ndarray) -> np.ndarray:
    """Values (n,) without those so large that differences of them have no number, which no axis can show."""
    return np.where(np.abs(y) < LARGEST, y, np.nan)


def label(name: str, unit: str) -> str:
    """The heading of an axis."""
    return heading(name, unit.replace("2", "²").replace(".", "·"))
