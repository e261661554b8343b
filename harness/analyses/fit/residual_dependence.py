"""Dependence of the residuals of a fit on time and on a lag: what the model lacks, by name."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...errors import option_text
from .fit_problem import FitProblem
from .measured_record import correlation_length
from .unknowns import DELAY, OFFSET

MIN_SHARE = 0.3  # share of the squares of the residuals from which a dependence is named
MIN_POWER = 0.02  # share of the power of a dependence: with less left by the unknowns, it cannot be separated from them
SCORE = 5.0  # standard deviations of a dependence beyond chance


@dataclass(frozen=True)
class Dependence:
    """A cause that explains residuals.

    Attributes
    ----------
    cause : str
        Sentence part that names it, with its size.
    share : float
        Share of the squares of the residuals that it explains.
    change : numpy.ndarray
        Changes (n,) of the residuals by it, in units of the noise.
    """

    cause: str
    share: float
    change: np.ndarray

    @property
    def text(self) -> str:
        """Return the sentence part on what it explains."""
        return f"{100 * self.share:.0f} % of the squares of the residuals vanish if {self.cause}"


def find_dependence(problem: FitProblem, e: np.ndarray, jacobian: np.ndarray) -> Dependence | None:
    """Return the dependence that explains most of residuals e (n,) with the derivatives (n, k); None if none does.

    The part of a dependence that the unknowns absorb explains nothing.
    """
    q, _ = np.linalg.qr(jacobian / (np.linalg.norm(jacobian, axis=0) + 1e-300))
    squares, best = float(e @ e), None
    for column, describe in candidate_columns(problem, e, jacobian):
        remainder = column - q @ (q.T @ column)
        power = float(remainder @ remainder)
        if power <= MIN_POWER * float(column @ column):
            continue
        size = float(remainder @ e) / power
        share = size**2 * power / squares
        independent = len(e) / correlation_length((e - size * remainder)[:, None])
        if share < max(MIN_SHARE, best.share if best else 0.0) or share * independent < SCORE**2 * (1 - share):
            continue
        best = Dependence(describe(-size), share, size * column)
    return best


def candidate_columns(
    problem: FitProblem, e: np.ndarray, jacobian: np.ndarray
) -> Iterator[tuple[np.ndarray, Callable[[float], str]]]:
    """Yield the change (n,) of the residuals by each cause per unit of its size, and the text on a size."""
    records = problem.records
    ends = np.cumsum([record.y.size for record in records])[:-1]
    shares, owners, noises, rates = [], [], [], []  # per residual: time in the record, column, and its noise and rate
    for record, residuals in zip(records, np.split(e, ends), strict=True):
        rows, width = record.y.shape
        prediction = record.y + residuals.reshape(rows, width) * record.noise
        shares.append(np.repeat((record.t - record.t[0]) / np.ptp(record.t), width))
        owners.append(np.tile(np.arange(width), rows))
        noises.append(np.tile(record.noise, rows))
        rates.append(np.gradient(prediction, record.t, axis=0).ravel())
    share, owner, noise = np.concatenate(shares), np.concatenate(owners), np.concatenate(noises)
    lag = -np.concatenate(rates) / noise
    for unknown, column in zip(problem.unknowns, jacobian.T, strict=True):
        if unknown.is_tunable:
            yield column * (share - 0.5), partial(describe_change, unknown.name, unknown.sign or 1)
    for j, name in enumerate(problem.outputs):
        span = max(float(np.ptp(record.y[:, j])) for record in records)
        yield (owner == j) / noise, partial(describe_offset, name, span)
        yield share * (owner == j) / noise, partial(describe_drift, name, span)
        yield lag * (owner == j), partial(describe_lag, name)


def describe_change(name: str, sign: int, size: float) -> str:
    """Return the text on an unknown that changes, without its size, which a motion that remembers does not show."""
    verb = "rises" if size * sign > 0 else "falls"
    return f"{name} {verb} during the record, as with warming up"


def describe_offset(name: str, span: float, size: float) -> str:
    """Return the text on a sensor with an offset."""
    option = option_text("free", [f"{OFFSET}({name})"])
    return f"{name} is off by {100 * size / span:+.2g} % of its range; {option} fits this"


def describe_drift(name: str, span: float, size: float) -> str:
    """Return the text on a sensor that drifts."""
    return f"{name} drifts by {100 * size / span:+.2g} % of its range, as with a sensor that warms up"


def describe_lag(name: str, size: float) -> str:
    """Return the text on a column that lags, or leads if the size in s is negative."""
    verb = "lags" if size > 0 else "leads"
    return (
        f"{name} {verb} by {abs(size):.2g} s, as behind a filter; {option_text('free', [f'{DELAY}({name})'])} fits this"
    )
