"""Steady motion of a mass on a spring with Coulomb friction under P cos(Omega t + phase), in closed form.

References
----------
J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Transactions of the ASME 53 (1931),
APM-53-9, 107-115.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import atan2, cos, pi, sin, sqrt

GRID = 200  # intervals in which roots are searched


@dataclass(frozen=True)
class SteadyMotion:
    """Steady motion that starts backward from its largest displacement.

    Attributes
    ----------
    amplitude : float
        Largest displacement in m.
    phase : float
        Phase in rad of the force when the mass starts backward.
    stop : float
        Time in s for which the mass sticks in each half cycle; 0 if it never stops.
    """

    amplitude: float
    phase: float
    stop: float


def steady_motion_without_stops(m: float, k: float, f: float, P: float, Omega: float) -> SteadyMotion:
    """Return the motion that slides all the time; only valid if f/P is small enough."""
    beta = Omega / sqrt(k / m)
    p, theta = P / k / (1.0 - beta * beta), pi / beta
    u = f / k * sin(theta) / (beta * (1.0 + cos(theta)))
    amplitude = sqrt(p * p - u * u)
    return SteadyMotion(amplitude, atan2(-u / p, amplitude / p), 0.0)


def steady_motion_with_stops(m: float, k: float, f: float, P: float, Omega: float) -> SteadyMotion:
    """Return the motion with one stop in each half cycle.

    The mass starts from A = (f + P cos(phase))/k and arrives at -A with zero speed before half a period.
    """
    from scipy.optimize import brentq

    omega, half_period = sqrt(k / m), pi / Omega
    p = P / k / (1.0 - (Omega / omega) ** 2)

    def motion(t: float, phase: float) -> tuple[float, float]:
        """Return position and speed after the time t of sliding backward."""
        c_1, c_2 = P * cos(phase) / k - p * cos(phase), Omega * p * sin(phase) / omega
        x = f / k + c_1 * cos(omega * t) + c_2 * sin(omega * t) + p * cos(Omega * t + phase)
        return x, omega * (c_2 * cos(omega * t) - c_1 * sin(omega * t)) - Omega * p * sin(Omega * t + phase)

    def arrival(phase: float) -> float:
        """Return the time in s at which the mass stops."""
        times = [half_period * i / GRID for i in range(1, GRID + 1)]
        end = next((t for t in times if motion(t, phase)[1] >= 0.0), half_period)
        return float(brentq(lambda t: motion(t, phase)[1], end - half_period / GRID, end, xtol=1e-16))

    def distance(phase: float) -> float:
        """Return the distance in m from -A at which the mass stops."""
        return motion(arrival(phase), phase)[0] + (f + P * cos(phase)) / k

    phases = [pi * i / GRID for i in range(1, GRID)]
    end = next(b for a, b in pairwise(phases) if distance(a) * distance(b) <= 0.0)
    phase = float(brentq(distance, end - pi / GRID, end, xtol=1e-16))
    return SteadyMotion((f + P * cos(phase)) / k, phase, half_period - arrival(phase))
