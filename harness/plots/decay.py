"""The figure of an identified decay: signal, turning points, envelope and fit, and the residuals below."""

from pathlib import Path

import numpy as np

from ..identify.fit import Identified
from ..identify.swing import value
from .style import BLUE, GREEN, HEIGHT, ORANGE, WIDTH, label, sheet


def draw(found: Identified, path: Path) -> None:
    """Save the figure as PNG."""
    record, best, turns = found.record, found.best, found.turns
    t, x = record.t[found.used], record.x[found.used]
    with sheet(path, 1.8 * WIDTH, 2.6 * HEIGHT) as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        above.plot(record.t, record.x, ".", color=BLUE, markersize=2.5, label="record")
        above.plot(t, best.x, color=ORANGE, linewidth=0.9, label=f"fit: {best.words}")
        times, sizes = envelope(found, float(t[-1]))
        for side, text in ((1, "its envelope"), (-1, None)):
            above.plot(times, best.rest + side * sizes, color=GREEN, linestyle="--", label=text)
        above.plot(turns.t, turns.x, "o", color="black", fillstyle="none", markersize=5, label="turning points")
        above.set_title(f"{record.name}: {best.words}")
        above.set_ylabel(label("x", record.unit))
        above.legend(loc="upper right", ncols=2)
        below.plot(t, x - best.x, ".", color=BLUE, markersize=2.5)
        below.axhline(0, color="black", linewidth=0.6)
        below.set_title(f"residuals (rms {best.rms:.3g} {record.unit})")
        below.set_ylabel(label("record - fit", record.unit))
        below.set_xlabel("t [s]")


def envelope(found: Identified, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Times in s and sizes (n,) of the turning points of the fitted motion, from its first one to `end`."""
    best = found.best
    times, sizes = [best.turn], [abs(best.y)]
    for stretches in best.swing.halves(best.y):
        begin, stop, terms = stretches[-1]
        if best.turn + stop / best.omega > end:
            break
        times.append(best.turn + stop / best.omega)
        sizes.append(abs(value(terms, stop - begin)))
    return np.array(times), np.array(sizes)
