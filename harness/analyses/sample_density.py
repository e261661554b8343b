"""Check that a run has enough samples for what is measured in it."""

import numpy as np

from ..errors import HarnessError

MIN_SAMPLES = 8  # in a half cycle or a slip: a parabola through the top samples is then accurate to 1e-4


def require_dense_sampling(t: np.ndarray, starts: np.ndarray, ends: np.ndarray, interval_name: str) -> None:
    """Raise HarnessError if one of the intervals has fewer than MIN_SAMPLES samples.

    Parameters
    ----------
    t : (m,) sample times in s
    starts, ends : (n,) bounds of the intervals in s
    interval_name : what an interval is, for the message
    """
    counts = np.searchsorted(t, ends, "right") - np.searchsorted(t, starts, "left")
    if len(counts) and counts.min() < MIN_SAMPLES:
        i = int(np.argmin(counts))
        # half the step that would do: with few samples the bounds of an interval are uncertain themselves
        step = 0.5 * float((ends - starts).min()) / MIN_SAMPLES
        raise HarnessError(
            f"each {interval_name} needs at least {MIN_SAMPLES} samples, and the one from t = {starts[i]:.6g} s to "
            f"{ends[i]:.6g} s has {counts[i]}: set grid to {step:.1g} s or less"
        )
