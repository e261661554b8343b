"""Whether the samples of a run are dense enough for what is measured in them."""

import numpy as np

from ..errors import HarnessError

MIN_SAMPLES = 8  # in a swing or a slip: the crest of a half wave, from three or four of them, is then right to 1e-4


def require_dense_sampling(t: np.ndarray, begins: np.ndarray, ends: np.ndarray, measured: str) -> None:
    """HarnessError if one of the stretches from `begins` to `ends` (n,) in s has fewer samples `t` (m,) than that."""
    counts = np.searchsorted(t, ends, "right") - np.searchsorted(t, begins, "left")
    if len(counts) and counts.min() < MIN_SAMPLES:
        i = int(np.argmin(counts))
        step = (
            0.5 * float((ends - begins).min()) / MIN_SAMPLES
        )  # the half, for where few samples are, ends are not sure
        raise HarnessError(
            f"{MIN_SAMPLES} samples are needed in each {measured}, and that from "
            f"t = {begins[i]:.6g} s to {ends[i]:.6g} s "
            f"has {counts[i]}: take a grid of {step:.1g} s"
        )
