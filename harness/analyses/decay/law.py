"""The equation of motion of a free decay, its unknowns, the seven laws of damping, and closed forms of two of them.

In the time theta = omega (t - t0), with y the displacement from rest and s = sign y',

    y'' + 2 zeta y' + s b y'^2 + s r + y = 0         (pendulum: sin y instead of y)

zeta = c/(2 m omega), r = f/k (a length), b = q/m (1/length) for a quadratic drag q v |v|, omega^2 = k/m.  The motion
starts from rest at y = A, where the body was held before, and ends at the first turning point with |y| <= r.  The loss
terms zeta, r and b are nonnegative.
"""

from itertools import combinations
from math import log, pi, sqrt

import numpy as np

from ...errors import HarnessError

UNKNOWNS = ("t0", "amplitude", "rest", "drift", "omega", "zeta", "r", "b")
T0, AMPLITUDE, REST, DRIFT, OMEGA, ZETA, R, B = range(8)
TERMS = ("zeta", "r", "b")
LAWS = tuple(law for size in (3, 2, 1) for law in combinations(TERMS, size))  # the full law first
TERM_NAMES = {"zeta": "viscous damping", "r": "dry friction", "b": "quadratic drag"}

Terms = tuple[str, ...]


def sublaws(terms: Terms) -> tuple[Terms, ...]:
    """Return every law with some of these terms, the full one first."""
    return tuple(law for law in LAWS if set(law) <= set(terms))


def unknown_indices(terms: Terms, drift: bool) -> np.ndarray:
    """Return the indices in UNKNOWNS of the values to fit for a law with these terms."""
    basic = [T0, AMPLITUDE, REST, *([DRIFT] if drift else []), OMEGA]
    return np.array(basic + [UNKNOWNS.index(term) for term in terms])


def describe_law(terms: Terms) -> str:
    """Return the names of the terms, as in 'viscous damping and dry friction'."""
    *others, last = (TERM_NAMES[term] for term in terms)
    return f"{', '.join(others)} and {last}" if others else last


def sticking_limit(r: np.ndarray, is_pendulum: bool) -> np.ndarray:
    """Return the largest displacement at which friction holds the body at rest (same shape as r)."""
    return np.arcsin(np.clip(r, 0.0, 1.0)) if is_pendulum else r


def damping_ratio(x_0: float, x_n: float, cycles: float) -> float:
    """Return zeta from the logarithmic decrement of two turning points `cycles` apart."""
    check_decrease(x_0, x_n)
    delta = log(x_0 / x_n) / cycles
    return delta / sqrt(4 * pi * pi + delta * delta)


def friction_from_envelope(x_0: float, x_n: float, cycles: float, stiffness: float) -> float:
    """Return friction from the linear envelope: a force for a stiffness in N/m, a torque for one in N.m/rad."""
    check_decrease(x_0, x_n)
    return stiffness * (x_0 - x_n) / (4 * cycles)


def check_decrease(x_0: float, x_n: float) -> None:
    """Raise HarnessError unless x_0 > x_n > 0."""
    if not x_0 > x_n > 0:
        raise HarnessError(
            f"the turning points do not decay: from {x_0:.6g} to {x_n:.6g}; the motion is at rest, driven or undamped"
        )
