"""Damping ratio or friction from two peaks of a free oscillation: logarithmic decrement and linear envelope.

    viscous       x_n = x_0 exp(-n delta),     zeta = delta/sqrt(4 pi^2 + delta^2)
    Coulomb       x_n = x_0 - 4 n f/k,         f   = k (x_0 - x_n)/(4 n)
    pin joint     theta_n = theta_0 - 4 n T_f/(m g a)  for small angles

x_0 and x_n are the magnitudes of turning points n cycles apart; n may be half-integer.  The rest position is zero.

References
----------
W. T. Thomson, Theory of Vibration, sections 2.6 and 2.7 (logarithmic decrement, Coulomb damping)
"""

from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from ...errors import HarnessError
from ...results.quantity import Quantity
from ...simulation.signals import check_sampling, column_of_role
from .law import damping_ratio, friction_from_envelope

if TYPE_CHECKING:
    from ...simulation.trajectory import Trajectory


FORCES = {"f": ("N", "friction force", False), "T_f": ("N.m", "joint torque", True)}  # unit, text, is a rotation


@dataclass(frozen=True)
class DecrementResult:
    """Result of the analysis 'decay'.

    Attributes
    ----------
    result : Quantity
        Measured quantity: zeta, f or T_f.
    cycles : float
        Number of cycles over which it was measured.
    times, positions : numpy.ndarray
        Times (n,) in s and positions (n,) of the turning points of these cycles.
    quantities : tuple of Quantity
        Peaks at both ends, and the result.
    """

    result: Quantity
    cycles: float
    times: np.ndarray
    positions: np.ndarray
    quantities: tuple[Quantity, ...]


def analyse(run: "Trajectory", gives: str, first: int = 0, cycles: float | None = None) -> DecrementResult:
    """Measure the decay of the recorded position.

    Parameters
    ----------
    gives : str
        Quantity to measure: zeta, f or T_f.
    first : int
        Number of the cycle whose peak is x_0.
    cycles : float, optional
        Number of cycles between x_0 and x_n; None for all that follow.

    Raises
    ------
    HarnessError
        If the run shows no decay, or has too few turning points or samples.
    """
    times, positions = find_extrema_from_velocity(
        run.time, column_of_role(run, "position"), column_of_role(run, "velocity")
    )
    times, positions, cycles = select_cycles(times, positions, first, cycles)
    check_sampling(run.time, times[:-1], times[1:], "half cycle")
    x_0, x_n = float(abs(positions[0])), float(abs(positions[-1]))
    if gives == "zeta":
        result = Quantity("zeta", damping_ratio(x_0, x_n, cycles), "1", f"damping ratio, {cycles:g} cycles")
    else:
        unit, text, is_rotation = FORCES[gives]
        force = friction_from_envelope(x_0, x_n, cycles, stiffness(run, is_rotation, f"the decay to {gives}"))
        result = Quantity(gives, force, unit, f"{text}, {cycles:g} cycles")
    unit = run.units[run.motion_outputs["position"]]
    ends = (
        Quantity("x_0", x_0, unit, f"peak {first:g}"),
        Quantity("x_n", x_n, unit, f"peak {first + cycles:g}"),
        Quantity("sample_0", sampled_peak(run, times[0]), unit, f"peak {first:g}, as sampled"),
        Quantity("sample_n", sampled_peak(run, times[-1]), unit, f"peak {first + cycles:g}, as sampled"),
    )
    return DecrementResult(result, cycles, times, positions, (*ends, result))


def stiffness(run: "Trajectory", is_rotation: bool, purpose: str) -> float:
    """Return k of a spring or m g a of a pendulum; HarnessError with the `purpose` if the model has neither."""
    from ...simulation.trajectory import get_parameter

    return prod(get_parameter(run, name, purpose) for name in (("m", "g", "a") if is_rotation else ("k",)))


def sampled_peak(run: "Trajectory", time: float) -> float:
    """Return the larger of the two samples around a turning point: the peak that a plot of the samples shows."""
    i = int(np.clip(np.searchsorted(run.time, time), 1, len(run.time) - 1))
    return float(np.abs(column_of_role(run, "position")[i - 1 : i + 1]).max())


def find_extrema_from_velocity(t: np.ndarray, x: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times and positions of the turning points: where the velocity changes sign or comes to rest.

    Between two samples the position is the cubic through their x and v, and the turning point is where its slope is
    zero; the error is of fourth order in the sample interval.  A start at rest counts if motion follows at once.

    Parameters
    ----------
    t, x, v : numpy.ndarray
        Times (n,) in s, positions (n,) and velocities (n,).
    """
    sign = np.sign(v)
    i = np.flatnonzero(sign[:-1] * sign[1:] < 0)
    h, x0, x1, v0, v1 = t[i + 1] - t[i], x[i], x[i + 1], v[i], v[i + 1]
    s = locate_zero_slope(h, x1 - x0, v0, v1)
    r = 1 - s
    cubic = (1 + 2 * s) * r * r * x0 + s * r * r * h * v0 + s * s * (3 - 2 * s) * x1 - s * s * r * h * v1
    rests = np.array([j for j in np.flatnonzero(sign == 0).tolist() if is_turning_point(sign, j)], int)
    times, positions = np.append(t[i] + s * h, t[rests]), np.append(cubic, x[rests])
    order = np.argsort(times, kind="stable")
    return times[order], positions[order]


def is_turning_point(sign: np.ndarray, i: int) -> bool:
    """Return whether the motion stops at sample i and does not continue in the same direction."""
    before = sign[i - 1] if i else 0.0
    if i and before == 0:
        return False  # the rest began earlier
    moving_samples = np.flatnonzero(sign[i + 1 :])
    if not len(moving_samples):
        return bool(i)
    return sign[i + 1 + moving_samples[0]] != before and (i > 0 or moving_samples[0] == 0)


def locate_zero_slope(h: np.ndarray, rise: np.ndarray, v0: np.ndarray, v1: np.ndarray) -> np.ndarray:
    """Return where in [0, 1] cubics (n,) have zero slope, for end slopes v0 and v1 of opposite sign.

    The slope is v0 + 2 b s + c s^2 with b = 3 rise/h - 2 v0 - v1 and c = 3 (v0 + v1) - 6 rise/h.
    """
    b = 3 * rise / h - 2 * v0 - v1
    c = 3 * (v0 + v1) - 6 * rise / h
    root = np.sqrt(np.maximum(b * b - c * v0, 0.0))
    q = np.where(b > 0, -(b + root), -(b - root))
    with np.errstate(divide="ignore", invalid="ignore"):
        first_root, second_root = np.where(q == 0, 0.5, v0 / q), np.where(c == 0, 2.0, q / c)
    # opposite end slopes: exactly one root is inside
    return np.where(abs(first_root - 0.5) <= abs(second_root - 0.5), first_root, second_root)


def select_cycles(
    times: np.ndarray, positions: np.ndarray, first: int, cycles: float | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the turning points from cycle `first` over `cycles` cycles (None: all that follow), and their cycles."""
    begin = 2 * first
    end = len(times) - 1 if cycles is None else begin + round(2 * cycles)
    if end >= len(times) or end <= begin:
        count = max(end, begin + 1) + 1
        raise HarnessError(
            f"the decay needs {count} turning points, and the run has {len(times)}: set a later stop, a finer grid "
            "or fewer cycles"
        )
    return times[begin : end + 1], positions[begin : end + 1], (end - begin) / 2
