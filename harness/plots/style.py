"""The look of every figure: colours, sizes, headings of axes."""

from typing import Any

from ..run import heading

# Okabe and Ito's colours, which stay apart for colour-blind readers.
BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
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


def label(name: str, unit: str) -> str:
    """The heading of an axis."""
    return heading(name, unit.replace("2", "²").replace(".", "·"))
