"""Draws a curve as inline SVG; colours come from the style sheet of the page."""

from itertools import pairwise
from math import ceil, floor, log10

WIDTH, HEIGHT = 640, 230  # of the view box
LEFT, RIGHT, TOP, BOTTOM = 70, 14, 10, 48  # margins for the tick labels
TICKS = 5


def draw_chart(times: list[float], values: list[float], label: str, axis: str = "time in s") -> str:
    """Return the SVG of values over times, or over another quantity; `label` and `axis` name both with their units."""
    low, high = min(values), max(values)
    margin = 0.05 * (high - low) or 1.0
    low, high = low - margin, high + margin

    def to_view_box(t: float, value: float) -> tuple[float, float]:
        x = LEFT + (t - times[0]) / (times[-1] - times[0]) * (WIDTH - LEFT - RIGHT)
        return x, TOP + (high - value) / (high - low) * (HEIGHT - TOP - BOTTOM)

    parts = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{label} over {axis}">']
    for value in tick_values(low, high):
        _, y = to_view_box(times[0], value)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    for t in tick_values(times[0], times[-1]):
        x, _ = to_view_box(t, low)
        parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 19}" text-anchor="middle">{t:g}</text>')
    points = [to_view_box(t, value) for t, value in zip(times, values, strict=True)]
    parts.append(f'<path class="curve" d="{relative_path(points)}"/>')
    parts.append(f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 6}" text-anchor="end">{axis}</text>')
    parts.append(f'<text x="{LEFT}" y="{HEIGHT - 6}">{label}</text></svg>')
    return "\n".join(parts)


def relative_path(points: list[tuple[float, float]]) -> str:
    """Return the path data of a polyline, with points relative to the one before, which compress to half the size.

    >>> relative_path([(0.0, 1.0), (0.26, 1.0), (0.5, 0.5)])
    'M0 1l0.3 0 0.2 -0.5'
    """
    rounded = [(round(10.0 * x), round(10.0 * y)) for x, y in points]  # in tenths, so that roundings do not add up
    steps = [(x - x0, y - y0) for (x0, y0), (x, y) in pairwise(rounded)]
    start = "M{:g} {:g}l".format(*(place / 10.0 for place in rounded[0]))
    return start + " ".join(f"{dx / 10.0:g} {dy / 10.0:g}" for dx, dy in steps)


def tick_values(low: float, high: float) -> list[float]:
    """Return about TICKS round numbers from low to high.

    >>> tick_values(-0.11, 0.11)
    [-0.1, -0.05, 0.0, 0.05, 0.1]
    """
    rough = (high - low) / TICKS
    power = 10.0 ** floor(log10(rough))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough * (1.0 - 1e-9))
    return [round(i * step, 12) + 0.0 for i in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]
