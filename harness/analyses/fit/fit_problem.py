"""Residuals of records as functions of the unknowns, and their minimum by the method of Levenberg and Marquardt."""

from collections.abc import Mapping, Sequence

import numpy as np

from ...scenes.run_spec import RunSpec
from ...simulation.derivative_runs import DerivativeRuns
from .measured_record import MeasuredRecord
from .unknowns import DELAY, GAIN, OFFSET, FeasibleRegion, Unknown

EXACT_STEPS, ROUGH_STEPS = (1e-6, 1e-6), (1e-5, 1e-4)  # of one-sided and central differences
ALL_STEPS = (EXACT_STEPS, (1e-5, 1e-5), ROUGH_STEPS)
CLEAR = 0.1  # difference of the logarithms of two determinants
MAX_COORDINATE = 60.0
HUBER = 3.0  # residuals in units of the noise, beyond which a robust loss is linear
LONGEST_STEP = 0.7  # of a coordinate
PROBE_SHARE, MAX_CORRECTION = 0.1, 0.4  # of a step: where its curvature is measured, and the size of the correction
MAX_DAMPINGS = 10  # tries of one step
MIN_DAMPING = 1e-10  # with less, the equations of parameters that are not determined are singular to rounding

Selection = tuple[np.ndarray, ...]  # the indices of the samples of each record


class FitProblem:
    """Residuals of the records, in units of their noise.

    Parameters
    ----------
    records : sequence of MeasuredRecord
        Records to fit.
    outputs : sequence of str
        Observed variables, one for each column of the records.
    unknowns : sequence of Unknown
        Numbers to fit.
    fixed_values : mapping
        Values of parameters that are not fitted.
    robust : bool
        Whether large residuals count linearly (Huber) instead of by their squares.
    derivatives : DerivativeRuns, optional
        Runs whose derivatives replace central differences, where these exist.
    """

    def __init__(
        self,
        records: Sequence[MeasuredRecord],
        outputs: Sequence[str],
        unknowns: Sequence[Unknown],
        fixed_values: Mapping[str, float],
        robust: bool = False,
        derivatives: DerivativeRuns | None = None,
    ) -> None:
        self.derivatives = derivatives
        self.records, self.outputs = tuple(records), list(outputs)
        self.unknowns, self.fixed_values, self.robust = tuple(unknowns), dict(fixed_values), robust
        self.sensors = [(i, unknown) for i, unknown in enumerate(self.unknowns) if unknown.column is not None]
        self.region = FeasibleRegion(self.unknowns)
        self.low, self.high = np.array([unknown.search_range for unknown in self.unknowns]).T
        self.all_samples: Selection = tuple(record.all_samples for record in self.records)
        self.first_samples: Selection = tuple(index[:2] for index in self.all_samples)
        self.central = False  # whether slopes need central differences
        self.steps = self.difference_steps()

    @property
    def n_samples(self) -> int:
        return sum(record.y.size for record in self.records)

    @property
    def scatter(self) -> float:
        """Return the root mean square of the residuals of white noise, in units of the noise.

        It is 1 unless the noise is known, and the unit of all limits of a search: one standard deviation of all columns
        scales the squares, and the search does not depend on it.
        """
        squares = sum(len(record.y) * float(np.sum((record.scatter / record.noise) ** 2)) for record in self.records)
        return float(np.sqrt(squares / self.n_samples))

    def values(self, z: np.ndarray, record: int) -> dict[str, float]:
        """Return the values to set for a record."""
        fitted_values = {
            unknown.variable: unknown.to_value(coordinate)
            for unknown, coordinate in zip(self.unknowns, z.tolist(), strict=True)
            if unknown.column is None and unknown.record in (None, record)
        }
        return self.fixed_values | fitted_values

    def predict(self, z: np.ndarray, selection: Selection) -> list[np.ndarray] | None:
        """Return the sensor signals at the selected samples of each record; None if the FMU refuses the values."""
        if max(map(abs, z.tolist())) > MAX_COORDINATE:
            return None
        predicted = []
        for i, (record, index) in enumerate(zip(self.records, selection, strict=True)):
            y = self.predict_record(z, record, i, index)
            if y is None:
                return None
            predicted.append(y)
        return predicted

    def predict_record(self, z: np.ndarray, record: MeasuredRecord, i: int, index: np.ndarray) -> np.ndarray | None:
        """Return the sensor signals at samples of a record, with the values of record `i`; None if refused."""
        delays = self.sensor_values(z, i, DELAY)
        y = record.simulate(self.values(z, i), index, delays)
        if y is None:
            return None
        for column, gain in self.sensor_values(z, i, GAIN).items():
            y[:, column] *= gain
        for column, offset in self.sensor_values(z, i, OFFSET).items():
            y[:, column] += offset
        return y

    def sensor_values(self, z: np.ndarray, record: int, kind: str) -> dict[int, float]:
        """Return the offset, gain or delay of the sensor of each column of a record that has such an unknown."""
        return {
            unknown.column: unknown.to_value(float(z[i]))
            for i, unknown in self.sensors
            if unknown.column is not None and unknown.variable == kind and unknown.record in (None, record)
        }

    def residuals(self, z: np.ndarray, selection: Selection) -> np.ndarray | None:
        """Return the residuals in units of the noise, record by record; None if the FMU refuses the values."""
        predicted = self.predict(z, selection)
        if predicted is None:
            return None
        parts = [
            ((y - (record.y if index is record.all_samples else record.part(index).y)) / record.noise).ravel()
            for y, record, index in zip(predicted, self.records, selection, strict=True)
        ]
        return self.limit_outliers(np.concatenate(parts))

    def limit_outliers(self, e: np.ndarray) -> np.ndarray:
        """Return residuals in units of the noise whose squares are those of Huber's loss, if the fit is robust."""
        if not self.robust:
            return e
        size = np.abs(e)
        return np.where(size > HUBER, np.sign(e) * np.sqrt(np.maximum(2 * HUBER * size - HUBER**2, 0.0)), e)

    def is_refused(self, z: np.ndarray) -> bool:
        """Return whether the FMU refuses the values at the start."""
        return self.predict(z, self.first_samples) is None

    def difference_steps(self) -> tuple[float, float]:
        """Return the steps of one-sided and of central differences.

        They are longer where runs with nearly equal values scatter, as those of solvers with step control do. The
        scatter is that of third differences.
        """
        index = tuple(samples[:: max(1, len(samples) // 200)] for samples in self.all_samples)
        for share in (0.5, 0.4, 0.6, 0.3, 0.7):
            z = self.low + (self.high - self.low) * share
            e = [residuals for i in range(4) if (residuals := self.residuals(z + 1e-7 * i, index)) is not None]
            if len(e) == 4:
                scatter = np.quantile(np.abs(e[0] - 3 * e[1] + 3 * e[2] - e[3]), 0.9) / 20**0.5
                return EXACT_STEPS if scatter < 1e-9 * np.ptp(e[0]) else ROUGH_STEPS
        return EXACT_STEPS

    def jacobian(
        self, z: np.ndarray, e: np.ndarray, selection: Selection, free: np.ndarray, central: bool
    ) -> np.ndarray:
        """Return the derivatives (n, free) of the residuals e (n,), one-sided if the FMU refuses the other side.

        Where central differences are needed, they are exact if the FMU has derivatives there.
        """
        if central and (exact := self.exact_jacobian(z, e, selection)) is not None:
            return exact[:, free]
        columns, h = np.zeros((len(e), len(free))), self.steps[central]
        for j, i in enumerate(free):
            d = h * np.eye(len(z))[i]
            up = self.residuals(z + d, selection)
            down = self.residuals(z - d, selection) if central or up is None else None
            ends = [(end, side) for end, side in ((up, 1), (down, -1), (e, 0)) if end is not None][:2]
            if len(ends) == 2:
                columns[:, j] = (ends[0][0] - ends[1][0]) / (h * (ends[0][1] - ends[1][1]))
        return columns

    def exact_jacobian(self, z: np.ndarray, e: np.ndarray, selection: Selection) -> np.ndarray | None:
        """Return the derivatives (n, k) of the residuals e (n,) by runs with derivatives; None if there are none."""
        if self.derivatives is None or any(unknown.variable == DELAY for _, unknown in self.sensors):
            return None
        blocks = []
        for i, (record, index) in enumerate(zip(self.records, selection, strict=True)):
            block = self.output_slopes(z, i, record.spec_of(index))
            if block is None:
                return None
            blocks.append((block / record.noise[:, None]).reshape(-1, len(z)))
        jacobian = np.concatenate(blocks)
        if self.robust:
            jacobian *= (HUBER / np.maximum(np.abs(e), HUBER))[:, None]
        return jacobian

    def output_slopes(self, z: np.ndarray, i: int, spec: RunSpec) -> np.ndarray | None:
        """Return the derivatives (samples, columns, k) of the sensor signals of record i; None if there are none."""
        assert self.derivatives is not None
        values = self.values(z, i)
        names = [
            unknown.variable for unknown in self.unknowns if unknown.column is None and unknown.record in (None, i)
        ]
        solution = self.derivatives.differentiate(spec, names, values)
        if solution is None:
            return None
        y, by_name = solution
        slopes, gains = np.zeros((*y.shape, len(z))), self.sensor_values(z, i, GAIN)
        for j, unknown in enumerate(self.unknowns):
            scale = unknown.slope(unknown.to_value(float(z[j])))
            if unknown.record not in (None, i):
                continue
            if unknown.column is not None:
                slopes[:, unknown.column, j] = scale * (y[:, unknown.column] if unknown.variable == GAIN else 1.0)
                continue
            slopes[:, :, j] = scale * by_name[:, names.index(unknown.variable)]
            for column, gain in gains.items():
                slopes[:, column, j] *= gain
        return slopes

    def choose_steps(self, z: np.ndarray, e: np.ndarray) -> np.ndarray:
        """Return the derivatives (n, k) of e (n,) at z (k,), by central differences if they are not exact.

        The steps of differences are chosen by their errors.

        Steps that are too short or too long add errors, which increase the determinant: a direction that hardly
        changes the residuals looks better determined than it is.
        """
        if (exact := self.exact_jacobian(z, e, self.all_samples)) is not None:
            return exact
        best, lowest = self.steps, np.inf
        for steps in ALL_STEPS:
            self.steps = steps
            jacobian = self.jacobian(z, e, self.all_samples, np.arange(len(z)), central=True)
            size = float(np.linalg.slogdet(jacobian.T @ jacobian)[1])
            if size < lowest - CLEAR or lowest == np.inf:
                best, lowest, best_jacobian = steps, size, jacobian
        self.steps = best
        return best_jacobian

    def minimize(
        self,
        z: np.ndarray,
        selection: Selection,
        max_steps: int,
        min_gain: float,
        free: np.ndarray | None = None,
        central: bool = False,
        goal: float = np.inf,
    ) -> tuple[float, np.ndarray]:
        """Return the sum of squares and the coordinates after steps of Levenberg and Marquardt inside the region.

        Parameters
        ----------
        z : numpy.ndarray
            Coordinates (k,) to start from.
        max_steps : int
            Maximum number of steps.
        min_gain : float
            Relative reduction of the sum of squares below which the steps end.
        free : numpy.ndarray, optional
            Indices of the coordinates to fit; by default all.
        goal : float
            Target for the sum of squares. The steps also end if the last one gains less than the one before and
            `max_steps` such steps would not reach the goal: along a curved valley the first steps gain more and more.
        """
        free = np.arange(len(z)) if free is None else free
        e, damping = self.residuals(z, selection), 1e-2
        if e is None:
            return np.inf, z
        squares, last_gain, is_central = float(e @ e), 0.0, central or self.central
        for _ in range(max_steps if len(free) else 0):
            jacobian = self.jacobian(z, e, selection, free, is_central)
            matrix, slope = jacobian.T @ jacobian, jacobian.T @ e
            scale = np.diag(np.maximum(np.diag(matrix), 1e-9 * matrix.max() or 1.0))
            for n in range(MAX_DAMPINGS):
                s, step = self.region.constrained_step(matrix + damping * scale, slope, z, free), np.zeros(len(z))
                if not np.isfinite(s).all():
                    return squares, z
                s *= min(1.0, LONGEST_STEP / max(float(np.abs(s).max()), 1e-300))
                step[free] = s
                if is_central:
                    step[free] += self.curvature_correction(
                        z, e, step, jacobian, matrix + damping * scale, selection, free
                    )
                new = self.residuals(z + step, selection)
                if new is not None and new @ new < squares:
                    break
                if new is None:
                    self.region.add_refusal(self.is_refused, z, step)
                damping = max(damping * 2.0 ** (n + 1), 1e-8)
            else:
                return squares, z
            before, squares = squares, float(new @ new)
            z, e, gain = z + step, new, before - squares
            damping = damping if n else max(damping * 0.1, MIN_DAMPING)
            if gain < min_gain * before or gain < last_gain < (squares - goal) / max_steps:
                break
            last_gain = gain
        return squares, z

    def curvature_correction(
        self,
        z: np.ndarray,
        e: np.ndarray,
        step: np.ndarray,
        jacobian: np.ndarray,
        matrix: np.ndarray,
        selection: Selection,
        free: np.ndarray,
    ) -> np.ndarray:
        """Return a correction of the `free` coordinates for a step along a curved valley; zeros without one.

        References
        ----------
        M. K. Transtrum, J. P. Sethna, Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares
        minimization, arXiv:1201.5885 (2012)
        """
        zeros = np.zeros(len(free))
        near = self.residuals(z + PROBE_SHARE * step, selection)
        if near is None:
            return zeros
        acceleration = 2 / PROBE_SHARE * ((near - e) / PROBE_SHARE - jacobian @ step[free])
        correction = self.region.constrained_step(matrix, jacobian.T @ acceleration, z + step, free) / 2
        scale = np.sqrt(np.diag(matrix))
        is_small = np.linalg.norm(scale * correction) < MAX_CORRECTION * np.linalg.norm(scale * step[free])
        return correction if is_small else zeros
