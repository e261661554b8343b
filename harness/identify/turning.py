"""The turning points of a record: noisy or clean, evenly sampled or not, about any rest position."""

from dataclasses import dataclass

import numpy as np

from ..errors import HarnessError
from .record import Record

SURE = 8.0  # times the noise: what a reversal must measure to be one
FINE = 1e-6  # share of the range that a reversal measures at least
CLEAN = 1e-4  # share of the range: noise below this leaves single samples to trust
FEWEST = 3  # turning points


@dataclass(frozen=True)
class Turns:
    """Times `t` (n,) in s and positions `x` (n,) of the turning points, the `noise` of a sample (its standard
    deviation, in the unit of x) and the half period `half` in s."""

    t: np.ndarray
    x: np.ndarray
    noise: float
    half: float


def find(record: Record) -> Turns:
    """The turning points; HarnessError where the record shows no decay to measure."""
    span = float(np.ptp(record.x))
    if not span > 0:
        raise HarnessError(f"{record.name} does not move: every position is {record.x[0]:.6g} {record.unit}")
    noise = noise_of(record.t, record.x)
    if span < 1.5 * SURE * noise:
        raise HarnessError(
            f"{record.name} is all noise: it spans {span:.3g} {record.unit}, and its samples scatter by {noise:.3g}; "
            "filter it, or sample at least 10 times a cycle"
        )
    at = reversals(record.x, max(SURE * noise, FINE * span))
    if len(at) < FEWEST:
        raise HarnessError(
            f"{record.name} has {len(at)} turning points that stand out of the noise ({noise:.3g} {record.unit}); "
            f"{FEWEST} or more are needed: take a longer record"
        )
    half = float(np.median(np.diff(record.t[at])))
    check_gaps(record, record.t[at[0]], record.t[at[-1]], half)
    points = [refined(record, i, half, noise > CLEAN * span) for i in at.tolist()]
    times, places = np.array(points).T
    turns = Turns(times, places, noise, half)
    check_decay(record, turns)
    return turns


def noise_of(t: np.ndarray, x: np.ndarray) -> float:
    """Standard deviation of the noise of x (n,): what is left of a sample by the cubic through its four neighbours.

    Robust: from the median.  Also the curvature that sampling is too coarse for counts as noise.
    """
    n = len(t) - 4
    near = np.array([t[i : i + n] for i in (0, 1, 3, 4)])
    weights = np.ones((4, n))
    for i in range(4):
        for j in range(4):
            if i != j:
                weights[i] *= (t[2:-2] - near[j]) / (near[i] - near[j])
    left = x[2:-2] - sum(weight * x[i : i + n] for weight, i in zip(weights, (0, 1, 3, 4), strict=True))
    return float(1.4826 * np.median(np.abs(left) / np.sqrt(1 + (weights**2).sum(axis=0))))


def reversals(x: np.ndarray, least: float) -> np.ndarray:
    """Samples at which x (n,) turns back by `least` or more, but for the first."""
    found: list[int] = []
    low = high = 0
    rising = None
    for i, value in enumerate(x.tolist()):
        if value > x[high]:
            high = i
        if value < x[low]:
            low = i
        if rising is not False and x[high] - value >= least:
            found.append(high)
            rising, low = False, i
        elif rising is not True and value - x[low] >= least:
            found.append(low)
            rising, high = True, i
    # the first reversal is where the record begins or was let go: no turning point of the free motion
    return np.array(found[1:], int)


def refined(record: Record, i: int, half: float, noisy: bool) -> tuple[float, float]:
    """Time and position of the extreme near sample i, by a polynomial through the samples around it."""
    t, x = record.t, record.x
    near = np.abs(t - t[i]) < half / 3 if noisy else np.zeros(len(t), bool)
    if near.sum() < 7:
        near = np.zeros(len(t), bool)
        near[max(i - 2, 0) : i + 3] = True
    line = np.polynomial.Polynomial.fit(t[near] - t[i], x[near], 4 if near.sum() > 7 else 2 if noisy else 4)
    roots = line.deriv().roots()
    real = roots[np.abs(roots.imag) < 1e-9 * half].real
    inside = real[np.abs(real) < half / 3]
    if not len(inside):
        return float(t[i]), float(x[i])
    root = inside[np.argmin(np.abs(inside))]
    return float(t[i] + root), float(line(root))


def check_gaps(record: Record, begin: float, end: float, half: float) -> None:
    """No pause between samples is longer than half a half cycle."""
    inside = (record.t >= begin) & (record.t <= end)
    pauses = np.diff(record.t[inside])
    longest = int(np.argmax(pauses))
    if pauses[longest] > half / 2:
        at = record.t[inside][longest]
        raise HarnessError(
            f"{record.name} has a gap of {pauses[longest]:.3g} s after t = {at:.6g} s, where a half cycle lasts "
            f"{half:.3g} s; cut the record there with --until or --from"
        )


def check_decay(record: Record, turns: Turns) -> None:
    """The swings do not grow."""
    swings = np.abs(np.diff(turns.x))
    if swings[-1] > swings[0] + 4 * turns.noise and swings[-1] > 1.001 * swings[0]:
        raise HarnessError(
            f"{record.name} grows, from a swing of {swings[0]:.4g} to one of {swings[-1]:.4g} {record.unit}: it is "
            "driven or gains energy, and has no decay to measure"
        )
