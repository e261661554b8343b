"""Curves as inline SVG, in the colours of the page."""

from html import escape

import numpy as np

WIDTH, HEIGHT, MARGIN = 320, 150, 6  # size of the view box, and the margin around the curve
COLUMNS = 400  # horizontal resolution to which a curve is reduced


def draw_curve(x: np.ndarray, y: np.ndarray, text: str) -> str:
    """Return the SVG of y (n,) over x (n,) with the text alternative `text`."""
    coordinates = [MARGIN + normalize(values) * (size - 2 * MARGIN) for values, size in ((x, WIDTH), (-y, HEIGHT))]
    points = " ".join(f"{coordinates[0][i]:.1f},{coordinates[1][i]:.1f}" for i in decimate(coordinates[0]))
    zero = MARGIN + (y.max() / (np.ptp(y) or 1.0)) * (HEIGHT - 2 * MARGIN)
    axis = f'<line x1="0" x2="{WIDTH}" y1="{zero:.1f}" y2="{zero:.1f}"/>' if y.min() <= 0 <= y.max() else ""
    head = f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(text)}">'
    return f'{head}{axis}<polyline points="{points}"/></svg>'


def normalize(values: np.ndarray) -> np.ndarray:
    """Scale values (n,) linearly to 0 ... 1."""
    return (values - values.min()) / (np.ptp(values) or 1.0)


def decimate(x: np.ndarray) -> np.ndarray:
    """Return the indices (m,) of the first and last point in each of COLUMNS columns."""
    column = np.floor(COLUMNS * normalize(x))
    turns = np.flatnonzero(np.diff(column))
    return np.unique(np.concatenate([[0], turns, turns + 1, [len(x) - 1]]))
