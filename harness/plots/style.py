"""The look of every figure: colours, sizes, headings of axes."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from ..run import heading

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
WIDTH, HEIGHT = 5.5, 2.3  # inches of one column and of one panel


@contextmanager
def sheet(path: Path, width: float, height: float) -> Iterator[Figure]:
    """A figure in this look, of a size in inches; saved as PNG when all has been drawn."""
    with rc_context(STYLE):
        figure = Figure(figsize=(width, height), dpi=130, layout="constrained")
        yield figure
        figure.savefig(path)


def label(name: str, unit: str) -> str:
    """The heading of an axis."""
    return heading(name, unit.replace("2", "²").replace(".", "·"))
