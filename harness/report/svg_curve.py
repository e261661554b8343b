"""A curve as an SVG drawing in the text of the page, in the colours of the page around it."""

from html import escape

import numpy as np

WIDTH, HEIGHT, MARGIN = 320, 150, 6  # of the drawing, which scales; the room around it
COLUMNS = 400  # in which a curve is drawn, however many points it has


def draw_curve(x: np.ndarray, y: np.ndarray, text: str) -> str:
    """The drawing of y (n,) over x (n,), with `text` in its place for those who do not see it."""
    places = [MARGIN + normalize(each) * (size - 2 * MARGIN) for each, size in ((x, WIDTH), (-y, HEIGHT))]
    points = " ".join(f"{places[0][i]:.1f},{places[1][i]:.1f}" for i in decimate(places[0]))
    zero = MARGIN + (y.max() / (np.ptp(y) or 1.0)) * (HEIGHT - 2 * MARGIN)
    axis = f'<line x1="0" x2="{WIDTH}" y1="{zero:.1f}" y2="{zero:.1f}"/>' if y.min() <= 0 <= y.max() else ""
    head = f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(text)}">'
    return f'{head}{axis}<polyline points="{points}"/></svg>'


def normalize(values: np.ndarray) -> np.ndarray:
    """Where values (n,) lie between the smallest and the largest, from 0 to 1."""
    return (values - values.min()) / (np.ptp(values) or 1.0)


def decimate(x: np.ndarray) -> np.ndarray:
    """The points (m,) of a curve that a picture needs: the first and the last in each of its columns."""
    column = np.floor(COLUMNS * normalize(x))
    turns = np.flatnonzero(np.diff(column))
    return np.unique(np.concatenate([[0], turns, turns + 1, [len(x) - 1]]))
