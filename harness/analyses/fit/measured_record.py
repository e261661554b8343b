"""A measured record in a fit: samples, inputs between them, the run at the same times, and the noise of all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from ...records.extraction import Samples
from ...scenes.run_spec import RunSpec
from ...simulation.stepping import merge_points
from ...simulation.whole_run import Run, Simulator
from ..estimation.estimate import interpolation_residuals, residual_correlation, robust_std
from .parameter_fit import FittedRecord

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


MAX_SAMPLES = 2500  # twice as many are averaged to this number of means of neighbours
MAX_AVERAGING_ERROR = 0.3  # of a mean of neighbouring samples, in units of the noise
INPUT_POINTS = 500  # of an input that suffice for a search
INPUT_NOISE = 1e-3  # of the range of an input with noise
MAX_PARTS = 32  # in the cache of a record
SHORTEST_INTERVAL = 1e-6  # between communication points, in intervals between samples


@dataclass(frozen=True)
class RecordPart:
    """The samples `index` of a record: their values y, and the run that returns the outputs there, as its `spec`."""

    index: np.ndarray
    y: np.ndarray
    spec: RunSpec
    run: Run


class MeasuredRecord:
    """Samples y (n, columns) at the times t (n,), the inputs between them, and the runs at the same times.

    An input has samples where a measured signal lacks one, so the inputs (m,) have times of their own, `knots` (m,).

    Parameters
    ----------
    simulator : Simulator
        Its specification has the observed outputs, one for each column.
    data : Samples
        The record in the units of the FMU.
    is_averaged : bool
        Whether a long record is averaged.

    Attributes
    ----------
    noise, scatter, step : numpy.ndarray
        Standard deviation of the noise (columns,), as it is known or as the scatter of neighbouring samples shows it;
        that scatter; and the step of the quantiser, which is 0 if there is none.
    width : int
        Number of samples whose mean each row of `y` is.
    subdivision : int
        Number of parts of each interval between samples, in each of which inputs are constant.
    """

    def __init__(self, simulator: Simulator, data: Samples, is_averaged: bool) -> None:
        t, y = data.t, data.y
        input_t = data.input_t if data.inputs else t
        self.simulator, self.name, self.sampled_t, self.sampled_y = simulator, data.name, t, y
        estimates = [estimate_noise(t, column) for column in y.T]
        self.step = np.array([step for _, step in estimates])
        self.width = len(t) // MAX_SAMPLES if is_averaged and len(t) > 2 * MAX_SAMPLES else 1
        self.t, self.y, inputs = t, y, dict(data.inputs)
        if self.width > 1:
            self.t, self.y = bin_means(t, self.width), bin_means(y, self.width)
            input_t = bin_means(input_t, self.width)
            inputs = {name: bin_means(u, self.width) for name, u in inputs.items()}
        self.knots = self.t
        if inputs:
            nearest = 0.0 if self.width == 1 else 0.5 * float(np.median(np.diff(input_t)))  # means at other times
            self.knots = merge_points(self.t, input_t[input_t < self.t[-1]], nearest)
        self.inputs = {name: np.interp(self.knots, input_t, u) for name, u in inputs.items()}
        self.input_noise = {name: robust_std(interpolation_residuals(input_t, u)) for name, u in inputs.items()}
        self.rows = np.searchsorted(self.knots, self.t)
        scatter = [estimate_noise(self.t, column)[0] for column in self.y.T]
        self.scatter = np.maximum(scatter, self.step / 12**0.5)
        known_sigma = np.array([data.sigma.get(name, 0.0) for name in data.columns])
        self.noise = np.where(known_sigma > 0, known_sigma / np.sqrt(self.width), self.scatter)
        self.all_samples = np.arange(len(self.t))
        self.parts: dict[int, RecordPart] = {}
        self.subdivide(1)

    @property
    def fitted_record(self) -> FittedRecord:
        """Return the samples for the result, without the runs."""
        return FittedRecord(self.name, self.t, self.y, self.noise, self.sampled_t, self.width)

    def subdivide(self, parts: int, stride: int = 1) -> None:
        """Divide the intervals between samples; there, inputs are splines through each `stride`-th sample."""
        self.subdivision, t = parts, self.knots
        shares = np.arange(parts) / parts
        self.fine_t = np.append((t[:-1, None] + np.diff(t)[:, None] * shares).ravel(), t[-1])
        if parts == stride == 1:
            self.fine_inputs = self.inputs
        else:
            spline_rows = np.unique(np.append(np.arange(0, len(t), stride), len(t) - 1))
            self.fine_inputs = {
                name: CubicSpline(t[spline_rows], u[spline_rows])(self.fine_t) for name, u in self.inputs.items()
            }
        self.spec = self.specify(self.t, self.fine_t, self.fine_inputs)
        self.run = self.simulator.prepare(self.spec)

    def specify(self, times: np.ndarray, knots: np.ndarray, inputs: Mapping[str, np.ndarray]) -> RunSpec:
        """Specify runs that return the outputs at `times` in s, with inputs at `knots` (n,) in s, first to last."""
        table = {"time": knots, **inputs} if inputs else {}
        start, stop = knots[[0, -1]].tolist()
        return replace(self.simulator.spec, inputs=table, start=start, stop=stop, times=times)

    def prepare(self, times: np.ndarray, knots: np.ndarray, inputs: Mapping[str, np.ndarray]) -> Run:
        """Prepare such runs."""
        return self.simulator.prepare(self.specify(times, knots, inputs))

    def simulate(
        self, values: Mapping[str, float], index: np.ndarray, delays: Mapping[int, float] | None = None
    ) -> np.ndarray | None:
        """Return the outputs (len(index), outputs) at the samples `index`, which contain the first; None if refused.

        Parameters
        ----------
        delays : mapping, optional
            Delay in s of the sensor of an output, by its position. An output has its start value before the run.
        """
        if delays:
            return self.simulate_delayed(values, index, delays)
        return self.run(values) if len(index) == len(self.t) else self.part(index).run(values)

    def spec_of(self, index: np.ndarray) -> RunSpec:
        """Return the specification of the run for the samples `index`."""
        return self.spec if len(index) == len(self.t) else self.part(index).spec

    @property
    def noisy_inputs(self) -> dict[str, float]:
        """Return the noise of the inputs that have some, relative to their range."""
        shares = {
            name: noise / max(float(np.ptp(self.inputs[name])), 1e-300) for name, noise in self.input_noise.items()
        }
        return {name: share for name, share in shares.items() if share > INPUT_NOISE}

    def simulate_noisy_inputs(self, values: Mapping[str, float], random: np.random.Generator) -> np.ndarray | None:
        """Return the outputs (n, outputs) with further noise in the inputs, of the size that they have."""
        inputs = {
            name: u + self.input_noise.get(name, 0.0) * random.normal(size=len(u)) for name, u in self.inputs.items()
        }
        if self.subdivision > 1:
            inputs = {name: CubicSpline(self.knots, u)(self.fine_t) for name, u in inputs.items()}
        return self.prepare(self.t, self.fine_t, inputs)(values)

    def part(self, index: np.ndarray) -> RecordPart:
        """Return the data of a run for the samples `index`. They are cached, because many runs use the same index."""
        if id(index) not in self.parts:
            if len(self.parts) >= MAX_PARTS:
                self.parts.clear()
            grid = self.rows[index]
            if self.inputs:
                grid = np.union1d(self.sparse_knots(index), grid)
            spec = self.specify(self.t[index], self.knots[grid], {name: u[grid] for name, u in self.inputs.items()})
            self.parts[id(index)] = RecordPart(index, self.y[index], spec, self.simulator.prepare(spec))
        return self.parts[id(index)]

    def sparse_knots(self, index: np.ndarray) -> np.ndarray:
        """Return rows of the inputs up to the last of the samples `index`, enough for a search."""
        return np.arange(0, self.rows[index[-1]] + 1, max(1, len(self.knots) // INPUT_POINTS))

    def simulate_delayed(
        self, values: Mapping[str, float], index: np.ndarray, delays: Mapping[int, float]
    ) -> np.ndarray | None:
        """Return the outputs at the samples, each earlier by its delay.

        The run has communication points there: interpolated outputs would have kinks between samples. Inputs keep
        their last value after the record, which a negative delay needs.
        """
        t, begin = self.t[index], self.t[0]
        shortest = SHORTEST_INTERVAL * (self.t[-1] - begin) / len(self.t)  # an FMU may refuse tiny steps
        shifted_times = [t - delays.get(j, 0.0) for j in range(len(self.simulator.spec.outputs))]
        sensor_times = [np.where(times - begin > shortest, times, begin) for times in shifted_times]
        knots, inputs = self.t[[0, index[-1]]], {}
        if self.inputs and len(index) == len(self.t):
            knots, inputs = self.fine_t, self.fine_inputs
        elif self.inputs:
            grid = self.sparse_knots(index)
            knots, inputs = self.knots[grid], {name: u[grid] for name, u in self.inputs.items()}
        points = np.unique(np.concatenate(sensor_times))
        steps = merge_points(points, knots, shortest)
        y = self.prepare(points, steps, {name: np.interp(steps, knots, u) for name, u in inputs.items()})(values)
        if y is None:
            return None
        return np.stack([y[np.searchsorted(points, times), j] for j, times in enumerate(sensor_times)], axis=1)

    def quantisation_errors(self, y: np.ndarray) -> np.ndarray:
        """Return the errors (n, columns) that the quantisers of a record of the signals y (n, columns) would make.

        Means of neighbouring samples have smaller errors only where the signal moves by a step or more.
        """
        errors = np.zeros_like(y)
        for j in np.flatnonzero(self.step):
            signal = np.interp(self.sampled_t, self.t, y[:, j]) if self.width > 1 else y[:, j]
            origin, step = self.sampled_y[0, j], self.step[j]
            column_errors = np.round((signal - origin) / step) * step + origin - signal
            errors[:, j] = bin_means(column_errors, self.width) if self.width > 1 else column_errors
        return errors

    def can_be_averaged(self, values: Mapping[str, float]) -> bool:
        """Return whether the means of the outputs over neighbouring samples are the outputs at their mean times."""
        errors = self.averaging_errors(values)
        return errors is not None and self.is_averaging_error_small(errors)

    def is_averaging_error_small(self, errors: np.ndarray) -> bool:
        """Return whether errors (n, columns) of the means, in units of the noise, are small beside the scatter."""
        return bool((np.abs(errors) * self.noise <= MAX_AVERAGING_ERROR * self.scatter).all())

    def averaging_errors(self, values: Mapping[str, float]) -> np.ndarray | None:
        """Return by how much means of the outputs over neighbouring samples exceed the outputs at their mean times.

        Returns
        -------
        numpy.ndarray or None
            Differences (n, columns) in units of the noise; None if the FMU refuses the values. Zero for records with
            inputs, which are known as means only.
        """
        if self.width == 1 or self.inputs:
            return np.zeros(self.y.shape)
        y, at_samples = self.run(values), self.prepare(self.sampled_t, self.sampled_t, {})(values)
        if y is None or at_samples is None:
            return None
        return np.asarray((bin_means(at_samples, self.width) - y) / self.noise)

    def growing_parts(self, shares: Sequence[float], points: int) -> list[np.ndarray]:
        """Return samples of growing parts of the record; each part has a share of the whole motion."""
        n, width = len(self.t), max(1, len(self.t) // 200)
        edges = np.arange(0, n, width)
        smooth = np.add.reduceat(self.y, edges) / np.diff(np.append(edges, n))[:, None]
        motion = np.append(0.0, np.cumsum(np.sum(np.abs(np.diff(smooth, axis=0)) / np.ptp(self.y, axis=0), axis=1)))
        progress = np.interp(np.arange(n), edges, 0.8 * motion / max(motion[-1], 1e-300) + 0.2 * edges / n)
        parts = []
        for share in shares:
            end = n if share == 1 else min(max(int(np.searchsorted(progress, share)), 20), n)
            count = max(40, int(points * max(end / n, 0.25)))
            parts.append(np.unique(np.linspace(0, end - 1, count).astype(int)))
        return parts
