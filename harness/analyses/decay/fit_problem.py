"""A record made ready to be fitted: times from its begin, values about their middle in amplitudes, and its start.

For a spring the law has no length of its own, so that positions are counted in amplitudes; the sine of a pendulum
wants radians.
"""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from ...records.record import MIN_SAMPLES, Record
from .energy_balance import estimate_losses
from .extrema import Extrema
from .law import AMPLITUDE, DRIFT, OMEGA, REST, T0, TERMS, UNKNOWNS, ZETA, Terms, unknown_indices
from .least_squares import FitError, least_squares
from .return_map import MOST, chain
from .signal_model import LAW, SignalModel

LEAST_NOISE = 1e-13  # share of the amplitude: no record is exact beyond
EXACT = 1e-9  # share of the motion that the series of the model leave open
NOWHERE = 30.0  # errors of a turning point that the motion never reaches
WINDOWS = (0.08, 0.2, 0.45, 1.0)  # shares of a record: the phase is known before the next is fitted
STEPS = 15  # of the fit of a window
DENSE = 10_000  # samples say nearly as much as more of them: a fit begins with so many
ROUGH = 1.3  # times the noise: residuals beyond ask for windows

FitResult = tuple[np.ndarray, float]  # the values of UNKNOWNS, and the squares they leave


@dataclass(frozen=True)
class FitProblem:
    """Samples `t`, `x` (n,) to be fitted by `model`; `origin` s, `level` and `unit` turn them back into the record's;
    `noise` of a sample; with or without `drift`; the half period `swing` in s; the `step` of a quantiser (or 0), in
    the unit of the record."""

    t: np.ndarray
    x: np.ndarray
    model: SignalModel
    time_origin: float
    offset: float
    scale: float
    noise: float
    drift: bool
    swing: float
    step: float
    last: dict[tuple[bytes, Terms], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict, init=False, repr=False)

    @property
    def exact(self) -> float:
        """Residuals below which no fit is better than another."""
        return EXACT * float(np.std(self.x))

    @property
    def motion(self) -> float:
        """The root mean square of the samples about their mean."""
        return float(np.sqrt(np.mean((self.x - self.x.mean()) ** 2)))

    def unknowns(self, terms: Terms) -> np.ndarray:
        return unknown_indices(terms, self.drift)

    def only(self, keep: np.ndarray | slice) -> Self:
        """The same with some of the samples; Unfit where these are too few to be fitted."""
        some = replace(self, t=self.t[keep], x=self.x[keep])
        if len(some.t) < MIN_SAMPLES:
            raise FitError(
                f"has only {len(some.t)} samples in a row that follow the free decay of one oscillator, and {MIN_SAMPLES} "
                "are needed",
                "sample finer, or cut out what is one with --from and --until",
            )
        return some

    def off(self, p: np.ndarray, terms: Terms) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (n,), signal less record, and their Jacobian; the last two of them are kept, for whoever judges a
        fit asks for what it ended with."""
        asked = p.tobytes(), terms
        if asked not in self.last:
            signal, jacobian = self.model(p, self.unknowns(terms), self.t)
            self.last[asked] = signal - self.x, jacobian
            if len(self.last) > 2:
                del self.last[next(iter(self.last))]
        return self.last[asked]

    def fit(self, p: np.ndarray, terms: Terms, steps: int = 30) -> FitResult:
        """The law with these terms, from the values p on."""
        unknowns, every = self.unknowns(terms), len(self.t) // DENSE
        if every > 1:
            thin = self.only(slice(None, None, every))
            p, _, _, _ = least_squares(lambda q: thin.off(q, terms), p, unknowns, steps)
        found, cost, _, _ = least_squares(lambda q: self.off(q, terms), p, unknowns, steps)
        return found, cost

    def fit_growing_windows(self, p: np.ndarray, terms: Terms) -> np.ndarray:
        """The same by growing windows, none shorter than five half swings."""
        least = int(np.searchsorted(self.t, self.t[0] + 5 * self.swing))
        for share in WINDOWS:
            size = max(int(share * len(self.t)), min(len(self.t), least))
            p, _ = self.only(slice(size)).fit(p, terms, STEPS)
        return p

    def rough(self, cost: float) -> bool:
        """Whether squares are more than noise leaves."""
        return cost > len(self.t) * (ROUGH * self.noise) ** 2

    def half_cycles(self, p: np.ndarray, most: int = MOST) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes and begins (N + 1,), in s, of the half swings of these values up to the end of the samples."""
        until = p[OMEGA] * (self.t[-1] - p[T0])
        found = chain(p[None, LAW], self.model.is_pendulum, self.model.floor, most, until)
        return found.amplitudes[:, 0], p[T0] + found.begins[:, 0] / p[OMEGA]

    def turned(self, p: np.ndarray, count: int) -> tuple[Self, np.ndarray]:
        """The same motion begun `count` half swings later, and its values."""
        amplitudes, begins = self.half_cycles(p, most=count)
        p = p.copy()
        p[AMPLITUDE], p[T0] = amplitudes[count], begins[count]
        return replace(self, model=replace(self.model, side=self.model.side * (-1) ** count)), p


def prepare_problem(record: Record, turns: Extrema, pendulum: bool, drift: bool) -> tuple[FitProblem, np.ndarray]:
    """The problem of a record, and the values of the full law with which its turning points agree best."""
    time_origin = float(record.t[0])
    times, first = turns.t - time_origin, turns.begin - time_origin
    middle = rest_positions(times, turns.x, drift or record.order > 0)
    side = -float(np.sign(turns.x[0] - middle[0]))
    a = np.abs(turns.x - middle)
    scale = 1.0 if pendulum else float(a.max())
    offset = float(middle[-1]) if record.order == 0 else float(np.median(record.x))
    a, places, error = a / scale, (turns.x - middle) / scale, turns.error / scale
    noise = max(turns.noise / scale, LEAST_NOISE * float(np.ptp(record.x)) / scale)
    omega = np.pi / turns.half * (1 + float(np.median(a)) ** 2 / 16 if pendulum else 1.0)
    error = max(error, 1e-9)
    model = SignalModel(
        side, record.order, pendulum, float(record.t[-1] - time_origin) / 2, max(1e-3 * error, 1e-6 * float(a.max()))
    )

    start = np.zeros(len(UNKNOWNS))
    start[T0], start[OMEGA] = first, omega
    start[ZETA:] = estimate_losses(a, TERMS, pendulum) if len(a) > 3 else (0.01, 0.0, 0.0)
    zeta, r, b = start[ZETA:]
    start[AMPLITUDE] = a[0] + max(2 * r + np.pi * zeta * a[0] + 4 / 3 * b * a[0] ** 2, 0.0)
    if pendulum:
        start[AMPLITUDE] = min(start[AMPLITUDE], 3.1)
    at_turns = replace(model, order=0)
    seed = fit_numbered_extrema(at_turns, start, times, places, a * omega / (3 * error), error)
    if record.order:
        seed[REST] = seed[DRIFT] = 0.0
    elif drift and len(middle) > 1 and times[-1] > times[0]:
        slope = (middle[-1] - middle[0]) / (times[-1] - times[0]) / scale
        seed[DRIFT] += slope
        seed[REST] += slope * (model.middle - times[-1])
    t, x = record.t - time_origin, (record.x - offset) / scale
    return FitProblem(t, x, model, time_origin, offset, scale, noise, drift, turns.half, turns.step), seed


def rest_positions(times: np.ndarray, places: np.ndarray, moving: bool) -> np.ndarray:
    """The rest position at each turning point (n,): one for all, or on a line where it may move."""
    if len(places) < 3:
        return np.full(len(places), np.mean(places))
    between = (places[:-2] + 2 * places[1:-1] + places[2:]) / 4
    if not moving or len(between) < 3:
        return np.full(len(places), np.median(between))
    return np.polyval(np.polyfit(times[1:-1], between, 1), times)


def fit_numbered_extrema(
    model: SignalModel, start: np.ndarray, times: np.ndarray, places: np.ndarray, weights: np.ndarray, error: float
) -> np.ndarray:
    """The values that agree best with turning points matched by their number, in which no phase can slip."""
    unknowns = unknown_indices(TERMS, False)
    if 2 * len(times) <= len(unknowns):
        return start

    def off(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at, x, jacobian = model.turns(p, unknowns, len(times))
        reached = np.isfinite(at)
        late = np.where(reached, (np.where(reached, at, 0.0) - times) * weights, NOWHERE)
        beside = np.where(reached, (np.where(reached, x, 0.0) - places) / error, NOWHERE)
        slopes = (
            np.where(reached[None, :, None], jacobian, 0.0)
            * np.stack([weights, np.full_like(weights, 1 / error)])[..., None]
        )
        return np.concatenate([late, beside]), slopes.reshape(-1, len(unknowns))

    return least_squares(off, start, unknowns)[0]
