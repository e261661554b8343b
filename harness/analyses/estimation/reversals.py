"""Reversals of a record: samples at which it turns by more than its noise."""

import numpy as np


def find_reversals(x: np.ndarray, threshold: float) -> np.ndarray:
    """Return the samples at which x (n,) reverses by `threshold` or more, including the first extremum."""
    reversals: list[int] = []
    low = high = 0
    rising = None
    values = x.tolist()
    for i, value in enumerate(values):
        if value > values[high]:
            high = i
        if value < values[low]:
            low = i
        if rising is not False and values[high] - value >= threshold:
            reversals.append(high)
            rising, low = False, i
        elif rising is not True and value - values[low] >= threshold:
            reversals.append(low)
            rising, high = True, i
    return np.array(reversals, int)
