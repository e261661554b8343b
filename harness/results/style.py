"""The look of every figure: colours, sizes, headings of axes."""

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

artist.kwdoc = lambda artist: ""  # the lists of properties in all docstrings, a third of what is still to be imported

from matplotlib.axes import Axes as Axes  # noqa: E402
from matplotlib.axis import Axis  # noqa: E402
from matplotlib.collections import QuadMesh  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from matplotlib.text import Text  # noqa: E402

# Okabe and Ito's colours, which stay apart for colour-blind readers.
BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
GREY = "#777777"  # of what is only there to compare with
# Methods of one family have one colour.
METHOD_COLOURS = {
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
    "svg.fonttype": "none",  # letters stay letters
    "svg.hashsalt": "friction",  # the same drawing is the same file
}
DARK = {  # what stands for a colour where the reader's screen is dark
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
MAX_VECTOR_MARKERS = 1000  # points with a mark each: more are one image in the drawing
LEGEND_ABOVE: dict[str, Any] = {  # of a legend above its panel, where it hides nothing
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "frameon": False,
    "borderaxespad": 0.2,
    "columnspacing": 1.2,
    "handlelength": 1.4,
}
MAX_DRAWN_VALUE = 1e150  # that is drawn
MAX_TEXT_LENGTH = 500  # letters of a text that are drawn
LINE_BREAKS = re.compile(
    r"(\s+|(?<=[._\]]))"
)  # where a text may go on in the next line: a model's names have no blanks
UNWRITABLE = re.compile(r"[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # in XML: a path may be no text
WIDTH, HEIGHT = 5.5, 2.3  # inches of one column and of one panel


@contextmanager
def open_figure(
    path: Path, width: float, height: float, layout: Literal["constrained"] | None = "constrained"
) -> Iterator[Figure]:
    """A figure in this look, of a size in inches; saved as SVG, light or dark as the reader's screen is, when all has
    been drawn.  Without a `layout`, which measures all of it twice to find the margins, these are given.

    Names and titles are drawn letter by letter, whatever is in them.  What nobody can draw, such as letters that the
    font lacks and numbers near the end of their range, is left out of the picture without a word.
    """
    with rc_context(STYLE), warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        figure = Figure(figsize=(width, height), dpi=130, layout=layout)
        yield figure
        for text in find_texts(figure):
            text.set_parse_math(False)
            text.set_text(UNWRITABLE.sub("\N{REPLACEMENT CHARACTER}", text.get_text()[:MAX_TEXT_LENGTH]))
        for part, within in ((figure, figure.texts), *((axes, find_texts(axes)) for axes in figure.axes)):
            place = part.get_window_extent()
            for text in within:
                wrap_text(text, place.height if text.get_rotation() == 90 else place.width)
        for axes in figure.axes:
            for crowd in filter(is_crowded, (*axes.lines, *axes.collections)):
                crowd.set_rasterized(True)
        if engine := figure.get_layout_engine():
            engine.execute(figure)
            figure.set_layout_engine(None)  # with one, all is drawn twice
        drawn = StringIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    short = re.sub(r' d="[^"]*"', lambda line: re.sub(r"(\.\d\d)\d+", r"\1", line[0]), drawn.getvalue())
    path.write_text(short.replace("</style>", f"{DARK_STYLE}</style>", 1), encoding="utf-8")


def is_crowded(within: artist.Artist) -> bool:
    """Whether something is drawn in so many pieces that nobody wants each of them in a file."""
    if isinstance(within, Line2D):
        return within.get_marker() not in ("None", None) and np.size(within.get_xdata()) > MAX_VECTOR_MARKERS
    return isinstance(within, QuadMesh)


def find_texts(within: artist.Artist) -> Iterator[Text]:
    """All texts in a figure but the numbers at its axes, where powers are set as mathematics."""
    for child in within.get_children():
        if isinstance(child, Text):
            yield child
        elif isinstance(child, Axis):
            yield from (child.label, child.offsetText)  # to ask for all of its children makes its ticks, each time anew
        else:
            yield from find_texts(child)


def wrap_text(text: Text, place: float) -> None:
    """Break what is longer than its `place`, in pixels, into lines."""
    extent, lines = text.get_window_extent(), text.get_text().splitlines()
    if (longest := max(extent.width, extent.height)) > place:
        folded = textwrap.TextWrapper(max(1, int(max(map(len, lines)) * place / longest)))
        folded.wordsep_re = LINE_BREAKS
        text.set_text("\n".join(map(folded.fill, lines)))


def mask_undrawable(y: np.ndarray) -> np.ndarray:
    """Values (n,) without those so large that differences of them have no number, which no axis can show."""
    return np.where(np.abs(y) < MAX_DRAWN_VALUE, y, np.nan)


def axis_label(name: str, unit: str) -> str:
    """The heading of an axis."""
    return column_heading(name, format_unit(unit))


def format_unit(unit: str) -> str:
    """A unit as figures show it."""
    return unit.replace("2", "²").replace(".", "·")
