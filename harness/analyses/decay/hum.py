"""Hum in a record: a steady sinusoid that is much faster than the motion, such as one of the mains.

Hum is a line in the spectrum of the residuals of a fit; a fit to the residuals gives its frequency.  A line at a low
multiple of the frequency of the motion, or one whose amplitude changes, belongs to the motion and stays.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from ...records.motion import Motion
from . import thresholds

PADDING = 4  # times the samples: between two frequencies of the spectrum, a line loses at most 5 % of its power


@dataclass(frozen=True)
class Hum:
    """A sinusoid, the real part of amplitude exp(-2 pi i frequency (t - origin)).

    Attributes
    ----------
    frequency : float
        Frequency in Hz.
    amplitude : complex
        Amplitude in the unit of the record.
    origin : float
        Time in s.
    """

    frequency: float
    amplitude: complex
    origin: float

    def values(self, t: np.ndarray) -> np.ndarray:
        """Return the values (n,) at times t (n,) in s."""
        return np.asarray((self.amplitude * np.exp(-2j * np.pi * self.frequency * (t - self.origin))).real)

    def subtract_from(self, record: Motion) -> Motion:
        """Return the record without the hum, with a note."""
        note = (
            f"Hum is subtracted: a steady sinusoid with an amplitude of {abs(self.amplitude):.2g} {record.unit} at "
            f"{self.frequency:.4g} Hz, or at a frequency of which this is an alias."
        )
        return replace(record, x=record.x - self.values(record.t), notes=(*record.notes, note))


def find_hums(t: np.ndarray, e: np.ndarray, motion_frequency: float, smallest: float) -> list[Hum]:
    """Return the hums in residuals.

    Parameters
    ----------
    t, e : numpy.ndarray
        Times (n,) in s and residuals (n,), samples minus model.
    motion_frequency : float
        Frequency of the motion in Hz.
    smallest : float
        Amplitude below which hum does not matter.
    """
    hums: list[Hum] = []
    while len(hums) < thresholds.MAX_HUMS:
        hum = find_largest_hum(t, e, motion_frequency)
        if hum is None or abs(hum.amplitude) < smallest:
            break
        hums.append(hum)
        e = e - hum.values(t)
    return hums


def find_largest_hum(t: np.ndarray, e: np.ndarray, motion_frequency: float) -> Hum | None:
    """Return the hum in residuals that exceeds the spectrum around it most, or None."""
    origin, step = float(t[0]), float(np.median(np.diff(t)))
    slots = np.rint((t - origin) / step).astype(int)
    if slots[-1] > thresholds.MAX_EMPTY_SLOTS * len(t):
        return None
    samples = np.zeros(slots[-1] + 1)
    samples[slots] = e - e.mean()
    size = PADDING * len(samples)
    power, frequencies = np.abs(np.fft.rfft(samples, size)) ** 2, np.fft.rfftfreq(size, step)
    spacing = float(frequencies[1])
    excess = power / local_median(power)
    excess[is_of_motion(frequencies, motion_frequency, PADDING * spacing)] = 0.0
    largest = int(np.argmax(excess))
    if not excess[largest] > thresholds.HUM_LINE:
        return None
    frequency = float(
        optimize.minimize_scalar(
            lambda f: -abs(fit_amplitude(t - origin, e, f)),
            bounds=(frequencies[largest] - spacing, frequencies[largest] + spacing),
            method="bounded",
            options={"xatol": 1e-6 * spacing},
        ).x
    )
    amplitude, half = fit_amplitude(t - origin, e, frequency), len(t) // 2
    first, second = (fit_amplitude(t[part] - origin, e[part], frequency) for part in (slice(half), slice(half, None)))
    if abs(first - second) > thresholds.STEADY_HUM * abs(amplitude):
        return None
    return Hum(frequency, amplitude, origin)


def is_of_motion(frequencies: np.ndarray, motion_frequency: float, resolution: float) -> np.ndarray:
    """Return which frequencies (n,) are as slow as the motion, or near one of its low multiples."""
    multiple = np.rint(frequencies / motion_frequency)
    is_near = np.abs(frequencies - multiple * motion_frequency) < thresholds.HARMONIC_WIDTH * resolution
    is_low = multiple <= thresholds.MAX_HARMONIC
    return (frequencies < thresholds.MIN_HUM_FREQUENCY * motion_frequency) | (is_near & is_low)


def local_median(power: np.ndarray) -> np.ndarray:
    """Return the median (n,) of a spectrum (n,) around each of its frequencies."""
    count = max(len(power) // (PADDING * thresholds.BACKGROUND_FREQUENCIES), 1)
    medians = [np.full(len(part), np.median(part)) for part in np.array_split(power, count)]
    return np.maximum(np.concatenate(medians), np.finfo(float).tiny)


def fit_amplitude(t: np.ndarray, e: np.ndarray, frequency: float) -> complex:
    """Return the complex amplitude of the sinusoid that fits residuals e (n,) at times t (n,)."""
    phase = 2 * np.pi * frequency * t
    cosine, sine = np.linalg.lstsq(np.column_stack([np.cos(phase), np.sin(phase)]), e, rcond=None)[0]
    return complex(cosine, sine)
