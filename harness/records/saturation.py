"""Samples at the end of a sensor's range, which hide the motion beyond it."""

from dataclasses import replace

import numpy as np

from .record import Record

MIN_STAY = 3  # samples at the largest value, in a peak
MIN_DWELL = 4.0  # times the samples at the level before the last; 1/(sqrt(2) - 1) = 2.4 at a rounded turning point


def leave_out_saturated(record: Record) -> Record:
    """Return a record without the samples at which the sensor was saturated, and with a note on them."""
    x = record.x
    if not len(x):
        return record
    is_saturated, levels, peaks = np.zeros(len(x), bool), [], 0
    for sign in (1.0, -1.0):
        side, count = find_saturated(sign * x)
        if count:
            levels.append(f"{x[side][0]:.6g}")
            is_saturated, peaks = is_saturated | side, peaks + count
    if not levels:
        return record
    note = (
        f"The sensor was saturated: {int(is_saturated.sum())} of {len(x)} samples, in {peaks} peaks, are exactly "
        f"{' or '.join(levels)} {record.unit}. They are left out; --from selects the record after them."
    )
    return replace(record, t=record.t[~is_saturated], x=x[~is_saturated], notes=(*record.notes, note))


def find_saturated(x: np.ndarray) -> tuple[np.ndarray, int]:
    """Return which samples of x (n,) are cut off at the largest value, and in how many peaks; none if it is not.

    A motion that is cut off stays at its largest value in several peaks, and is rarely near it otherwise.  A motion
    that is only rounded passes the level before the last nearly as long; one that is held before its release is at
    rest in one peak, so the longest stay does not count.
    """
    none = np.zeros(len(x), bool), 0
    is_highest, is_low = x == x.max(), x < (x.max() + x.min()) / 2
    if not is_low.any():
        return none
    peak = np.cumsum(np.diff(is_low.astype(int), prepend=0) < 0)  # number of the peak; the motion is low between two
    stays = np.bincount(peak[is_highest])
    stays = np.sort(stays[stays >= MIN_STAY])[:-1]
    second = x[~is_highest].max()
    near = int(((x >= second - (x.max() - second) / 2) & ~is_highest).sum())
    return (is_highest, len(stays) + 1) if stays.sum() > MIN_DWELL * near else none
