"""The turning points of a record: noisy or clean, evenly sampled or not, about any rest position.

They are found in a smoothed copy, and only number and place the half swings for the fits that follow.  Of a velocity
the copy is its integral; of an acceleration it is -a/omega^2, the position but for the small share of the losses.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...errors import HarnessError
from ...records.record import Record
from .noise import estimate_noise, find_reversals, savitzky_golay

SURE = 8.0  # times the noise: what a reversal of the record must measure to be one
SMOOTHED = 18.0  # the same of a smoothed record, over the root of the samples in a window
FINE = 1e-6  # share of the range that a reversal measures at least
CLEAN = 1e-4  # share of the range: noise below this leaves single samples to trust
WINDOW = 0.35  # half periods that a smoothing window spans
DENSE = 200  # samples of a half period are enough to find where it ends
PAUSE = 0.8  # of a half period without a sample is a gap
FEWEST = 3  # turning points
ENOUGH = 6  # to number the swings before a gap, rather than those after it
WIDE = 2.0  # rad: beyond, a pendulum is begun at a turning point that was seen


@dataclass(frozen=True)
class Extrema:
    """Times `t` (n,) in s and positions `x` (n,) of the turning points after the one at `begin`; the `noise` of a
    sample and the `step` of a quantiser (or 0), in the unit of the record; the `half` period in s; from where on the
    record is one piece (`start`); and the `error` of a position."""

    t: np.ndarray
    x: np.ndarray
    begin: float
    half: float
    noise: float
    step: float
    start: float
    error: float


def find_extrema(record: Record, pendulum: bool) -> Extrema:
    """The turning points; HarnessError where the record shows no decay to measure."""
    span = float(np.ptp(record.x))
    if not span > 0:
        raise HarnessError(f"{record.name} does not move: every value is {record.x[0]:.6g} {record.unit}")
    noise, step = estimate_noise(record.t, record.x)
    half = estimate_half_period(record, noise, span)
    pieces = gapless_slices(record, half)
    found = [extrema_in_slice(record, piece, half, noise, step, span, pendulum) for piece in pieces]
    enough = [turns for turns in found if turns is not None and len(turns.t) >= ENOUGH]
    longest = max(filter(None, found), key=lambda turns: len(turns.t), default=None)
    best = enough[0] if enough else longest
    if best is None or len(best.t) < FEWEST - 1:
        count = 0 if best is None else len(best.t) + 1
        if span < 1.5 * SURE * noise:
            raise HarnessError(
                f"{record.name} is all noise: it spans {span:.3g} {record.unit}, and its samples scatter by "
                f"{noise:.3g}; filter it, or sample at least 10 times a cycle"
            )
        raise HarnessError(
            f"{record.name} has {count} turning points that stand out of the noise ({noise:.3g} {record.unit}); "
            f"{FEWEST} or more are needed: take a longer record"
        )
    check_decay(record, best)
    return best


def estimate_half_period(record: Record, noise: float, span: float) -> float:
    """In s, from the record as it is where its noise allows, otherwise from its spectrum."""
    at = find_reversals(record.x, max(SURE * noise, FINE * span))
    if len(at) >= 4:
        return float(np.median(np.diff(record.t[at[1:]])))
    step = (record.t[-1] - record.t[0]) / (len(record.t) - 1)
    even = np.interp(record.t[0] + step * np.arange(len(record.t)), record.t, record.x)
    size = 1 << int(np.ceil(np.log2(8 * len(even))))
    peak = int(np.argmax(np.abs(np.fft.rfft(even - even.mean(), size))))
    return 0.5 * size * step / max(peak, 1)


def gapless_slices(record: Record, half: float) -> list[slice]:
    """The record between its gaps."""
    pauses = np.diff(record.t)
    gaps = np.flatnonzero(pauses > max(PAUSE * half, 3 * float(np.median(pauses)))) + 1
    ends = [0, *gaps.tolist(), len(record.t)]
    pieces = [slice(low, high) for low, high in pairwise(ends) if high - low >= 8]
    return pieces or [slice(0, len(record.t))]


def extrema_in_slice(
    record: Record, piece: slice, half: float, noise: float, step: float, span: float, pendulum: bool
) -> Extrema | None:
    """The turning points in one piece of the record; None where it has too few."""
    t, x = record.t[piece], record.x[piece]
    dt = (t[-1] - t[0]) / (len(t) - 1)
    block = max(1, int(half / dt / DENSE))
    even = np.interp(t[0] + dt * np.arange(len(t)), t, x)
    u = even[: len(even) // block * block].reshape(-1, block).mean(axis=1)
    g = t[0] + dt * (block * np.arange(len(u)) + (block - 1) / 2)
    dt, grain = dt * block, noise / np.sqrt(block)
    width = max(int(WINDOW * half / dt) // 2 * 2 + 1, 5)
    if width >= len(u) // 2:
        return None
    y = savitzky_golay(u, width, 4 if width > 5 else 3) if width > 5 or noise > CLEAN * span else u
    least = max(SMOOTHED * grain / np.sqrt(width), FINE * span)
    if record.order:
        y, least = integrate_to_position(y, dt, half, record.order, least, pendulum)
        span = float(np.ptp(y))
    i = find_reversals(y, least)
    if len(i) < FEWEST:
        return None
    i = select_regular_reversals(i, half / dt)
    i = i[(i < len(y) - 1 - width // 2) | (np.arange(len(i)) < 4)]
    if len(i) < FEWEST:
        return None
    begin, i = locate_start(y, g, i, width)
    reach = max(1, min(width // 4, int(min(i[0], len(y) - 1 - i[-1]))))
    before, top, after = y[i - reach], y[i], y[np.minimum(i + reach, len(y) - 1)]
    bend = before - 2 * top + after
    shift = np.clip(0.5 * (before - after) / np.where(bend == 0, 1, bend), -1, 1)
    times, places = g[i] + shift * reach * dt, top - 0.25 * (before - after) * shift
    error = max(1.5 * least / SMOOTHED, 2e-4 * float(np.ptp(places)) / 2)
    if pendulum and len(places) > 6 and abs(places[0] - places[1]) > 2 * WIDE:
        begin, times, places = times[0], times[1:], places[1:]  # a turning point near pi is not made up
    return Extrema(times, places, begin, half, noise, step, float(t[0]), error)


def select_regular_reversals(i: np.ndarray, half: float) -> np.ndarray:
    """The reversals (samples) of a free motion whose half period is about `half` samples, and the one before.

    What is quicker before them is the ringing of the smoothed copy at a release; where they become irregular they are
    lost in noise, or disturbed.
    """
    gaps = np.diff(i)
    long = gaps > 0.5 * half
    swings = np.flatnonzero(long[:-1] & long[1:])
    first = int(swings[0]) if len(swings) else 0
    i, gaps = i[first:], gaps[first + 1 :]
    rough = np.flatnonzero((gaps[1:] > 1.5 * gaps[:-1]) | (gaps[1:] < 0.65 * gaps[:-1]))
    return i[: rough[0] + 3] if len(rough) else i


def locate_start(y: np.ndarray, g: np.ndarray, i: np.ndarray, width: int) -> tuple[float, np.ndarray]:
    """When the motion began, or would have, from rest; and the turning points (samples) after that.

    The first reversal is where the record begins, where it was let go from a hold, or where it turned.
    """
    gap = g[i[2]] - g[i[1]]
    share = (g[i[1]] - g[i[0]]) / gap
    if share > 1.2 or i[0] <= width // 4:  # held, or let go, or begun after a turning point
        return float(g[i[0]] if 0.9 < share <= 1.2 else g[i[1]] - gap), i[1:]
    if abs(y[0] - y[i[0]]) > 0.25 * abs(y[i[1]] - y[i[0]]):  # begun in free motion
        return float(2 * g[i[0]] - g[i[1]]), i
    return float(g[i[0]]), i[1:]  # begun near a turning point, or let go after a short while


def integrate_to_position(
    y: np.ndarray, dt: float, half: float, order: int, least: float, pendulum: bool
) -> tuple[np.ndarray, float]:
    """About the position, from a smoothed velocity or acceleration; and the least reversal of it that counts."""
    i = find_reversals(y, least)[1:]
    middle = float(np.median((y[i[:-2]] + 2 * y[i[1:-1]] + y[i[2:]]) / 4)) if len(i) > 2 else float(np.mean(y))
    omega = np.pi / half
    if order == 1:
        return np.concatenate([[0.0], np.cumsum((y[1:] + y[:-1]) / 2 - middle) * dt]), least / omega
    y = (middle - y) / omega**2
    return np.arcsin(np.clip(y, -1, 1)) if pendulum else y, least / omega**2


def check_decay(record: Record, turns: Extrema) -> None:
    """The swings do not grow."""
    swings = np.abs(np.diff(turns.x))
    if swings[-1] > swings[0] + 8 * turns.error and swings[-1] > 1.001 * swings[0]:
        raise HarnessError(
            f"{record.name} grows, from a swing of {swings[0]:.4g} to one of {swings[-1]:.4g} {record.base}: it is "
            "driven or gains energy, and has no decay to measure"
        )
