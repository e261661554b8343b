"""Jumps of an output in two runs: which are the same, and how much their times differ.

The time of a jump is known up to the communication step in which it is. An event at a communication point may be before
that point in one run and after it in another, so values there differ by the whole jump, however exact both runs are.
"""

import numpy as np

JUMP_RATIO = 10.0  # of a jump to the changes in the communication steps before and after it
SIZE_DIFFERENCE = 0.25  # of the sizes of the same jump in two runs, relative to the larger one

Interval = tuple[float, float]  # begin and end in s


def find_jumps(time: np.ndarray, column: np.ndarray) -> list[tuple[Interval, float]]:
    """Return the communication step of each jump of an output (n,), and the size of the jump.

    A whole number, a Boolean or a text jumps wherever it changes.
    """
    change = np.diff(column.astype(float))
    if column.dtype.kind == "f":
        size = np.append(np.append(0.0, np.abs(change)), 0.0)
        is_jump = size[1:-1] > JUMP_RATIO * np.maximum(size[:-2], size[2:])
    else:
        is_jump = change != 0
    return [((float(time[i]), float(time[i + 1])), float(change[i])) for i in np.flatnonzero(is_jump)]


def match_jumps(
    first: list[tuple[Interval, float]], second: list[tuple[Interval, float]], longest: float
) -> list[tuple[Interval, Interval]]:
    """Return the communication steps of the jumps that both runs have; times differ by at most `longest` in s."""
    pairs, begin = [], 0
    for interval, size in first:
        for i in range(begin, len(second)):
            other, other_size = second[i]
            if other[0] - interval[1] > longest:
                break
            is_same = abs(size - other_size) <= SIZE_DIFFERENCE * max(abs(size), abs(other_size))
            if is_same and distance(interval, other) <= longest:
                pairs.append((interval, other))
                begin = i + 1
                break
    return pairs


def distance(interval: Interval, other: Interval) -> float:
    """Return by how much the times in two intervals differ at least, in s; 0 if they overlap."""
    return max(0.0, other[0] - interval[1], interval[0] - other[1])


def is_between(times: np.ndarray, pairs: list[tuple[Interval, Interval]], tolerance: float) -> np.ndarray:
    """Return the mask (n,) of the times in s at which a jump has taken place in one run and not in the other."""
    mask = np.zeros(len(times), bool)
    for interval, other in pairs:
        begin, end = min(interval[0], other[0]), max(interval[1], other[1])
        mask |= (times > begin + tolerance) & (times <= end + tolerance)
    return mask
