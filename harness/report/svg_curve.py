"""Curves as inline SVG, in the colours of the page."""

from html import escape

import numpy as np

WIDTH, HEIGHT, MARGIN = 320, 150, 6  # size of the view box, and the margin around the curve
COLUMNS = 400  # horizontal resolution to which a curve is reduced


def draw_curve(x: np.ndarray, y: np.ndarray, text: str, stuck: np.ndarray) -> str:
    """Return the SVG of y (n,) over x (n,) with the text alternative `text`, with emphasis on `stuck` samples."""
    coordinates = [MARGIN + normalize(values) * (size - 2 * MARGIN) for values, size in ((x, WIDTH), (-y, HEIGHT))]
    curve = draw_line(coordinates, decimate(coordinates[0]), "")
    rests = [draw_line(coordinates, ends, ' class="stuck"') for ends in find_intervals(stuck)]
    zero = MARGIN + (y.max() / (np.ptp(y) or 1.0)) * (HEIGHT - 2 * MARGIN)
    axis = f'<line x1="0" x2="{WIDTH}" y1="{zero:.1f}" y2="{zero:.1f}"/>' if y.min() <= 0 <= y.max() else ""
    head = f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(text)}">'
    return f"{head}{axis}{curve}{''.join(rests)}</svg>"


def draw_line(coordinates: list[np.ndarray], samples: np.ndarray, attributes: str) -> str:
    """Return the SVG of a line through the samples with the given indices (m,)."""
    points = " ".join(f"{coordinates[0][i]:.1f},{coordinates[1][i]:.1f}" for i in samples)
    return f'<polyline{attributes} points="{points}"/>'


def find_intervals(selected: np.ndarray) -> np.ndarray:
    """Return the indices (m, 2) of the first and the last sample of each interval that is selected (n,)."""
    changes = np.flatnonzero(np.diff(selected, prepend=False, append=False))
    return changes.reshape(-1, 2) - [0, 1]


def normalize(values: np.ndarray) -> np.ndarray:
    """Scale values (n,) linearly to 0 ... 1."""
    return (values - values.min()) / (np.ptp(values) or 1.0)


def decimate(x: np.ndarray) -> np.ndarray:
    """Return the indices (m,) of the first and last point in each of COLUMNS columns."""
    column = np.floor(COLUMNS * normalize(x))
    turns = np.flatnonzero(np.diff(column))
    return np.unique(np.concatenate([[0], turns, turns + 1, [len(x) - 1]]))
