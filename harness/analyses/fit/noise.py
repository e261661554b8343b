"""Noise of a record and of the residuals of a fit: scatter, quantisation, correlation."""

import numpy as np

from ..estimation.noise import interpolation_residuals, residual_correlation, robust_std

MAX_DIVISOR = 8  # of the smallest difference of two levels that is tried as the step of a quantiser
MAX_STEP_ERROR = 0.02  # of a step, by which levels may miss multiples of it
# with fewer levels, none of which may be one step apart, larger divisors are tried with a smaller error
FEW_LEVELS = 100
MAX_DIVISOR_OF_FEW, MAX_STEP_ERROR_OF_FEW = 10_000, 1e-5
SMALLEST_NOISE = 1e-9  # of the range
SUMMED_SHARES = (20, 60, 200)  # sums are over so many parts of the record
SHORTEST_CORRELATION = 0.05  # correlation at which the sum of correlations ends


def estimate_noise(t: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Return the standard deviation of the noise of samples x (n,), and the step of a quantiser, or 0.

    The noise is at least that of the quantiser, step/sqrt(12).
    """
    scatter = robust_std(interpolation_residuals(t, x))
    step = quantiser_step(x)
    return max(scatter, step / 12**0.5, SMALLEST_NOISE * float(np.ptp(x))), step


def quantiser_step(x: np.ndarray) -> float:
    """Return the largest step of which the differences of the levels of samples x (n,) are multiples; 0 if none is.

    A record of long rests has few levels, which may all be many steps apart.
    """
    gaps = np.diff(np.unique(x))
    gaps = gaps[gaps > SMALLEST_NOISE * np.ptp(x)]
    if not len(gaps):
        return 0.0
    attempts = [(1, MAX_DIVISOR, MAX_STEP_ERROR)]
    if len(gaps) < min(FEW_LEVELS, len(x) / 2):
        attempts.append((MAX_DIVISOR + 1, MAX_DIVISOR_OF_FEW, MAX_STEP_ERROR_OF_FEW))
    for first, last, max_error in attempts:
        steps = gaps.min() / np.arange(first, last + 1)
        counts = gaps[:, None] / steps
        fits = np.abs(counts - np.round(counts)).max(axis=0) < max_error
        if fits.any():
            return float(steps[np.argmax(fits)])
    return 0.0


def significant_correlation(e: np.ndarray) -> float:
    """Return the correlation of neighbouring residuals e (n, columns); 0 if they are white noise."""
    widths = {max(len(e) // parts, 2) for parts in SUMMED_SHARES}
    for column in e.T:
        correlation, is_correlated = residual_correlation(column, widths)
        if is_correlated:
            return correlation
    return 0.0


def correlation_length(e: np.ndarray) -> float:
    """Return the number of residuals e (n, columns) that count as one: 1 + 2 (sum of the correlations)."""
    longest = 1.0
    for column in e.T:
        spectrum = np.abs(np.fft.rfft(column, 2 * len(column))) ** 2
        correlations = np.fft.irfft(spectrum)[: max(len(column) // 4, 2)]
        correlations = correlations / max(correlations[0], 1e-300)
        end = int(np.argmax(correlations < SHORTEST_CORRELATION)) or len(correlations)
        longest = max(longest, 1 + 2 * float(correlations[1:end].sum()))
    return longest


def bin_means(x: np.ndarray, width: int) -> np.ndarray:
    """Return the first of x (n, ...), and the means of every `width` of the others; the last may be over fewer."""
    edges = np.append(0, np.arange(1, len(x), width))
    counts = np.diff(np.append(edges, len(x))).reshape(-1, *[1] * (x.ndim - 1))
    return np.asarray(np.add.reduceat(x, edges, axis=0) / counts)
