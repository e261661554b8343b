"""Closed form of a body on a plane, with isotropic friction f under a constant force F along x, and the puck by it.

With the angle phi from the force to the velocity, u = tan(phi/2) falls at the rate F u/(m s), and the speed s is
proportional to u^(f/F) (1 + u^2)/(2 u).  Time and position are then sums of powers of u.
"""

from collections.abc import Callable, Sequence
from math import atan2, cos, hypot, sin
from typing import Any

import numpy as np

from harness.references.certified_reference import POINTS, relative_errors
from harness.simulation.solution import Solution

DIGITS, BISECTIONS = 40, 140
SLOW = 1e-3  # m/s: below this speed the direction turns too fast for the second route


def rest(m: float, F: float, f: float, speed: float, phi: float) -> tuple[float, float, float]:
    """Return time and position of the rest; F < f."""
    from mpmath import mp

    with mp.workdps(DIGITS):
        path = _path(m, F, f, speed, phi)
        return tuple(map(float, path(0)[:3]))  # type: ignore[return-value]


def motion(m: float, F: float, f: float, speed: float, phi: float, times: Sequence[float]) -> np.ndarray:
    """Return x, y, v_x and v_y at the times; F < f."""
    from mpmath import mp

    with mp.workdps(DIGITS):
        path = _path(m, F, f, speed, phi)
        stop, x, y, *_ = path(0)
        rows: list[Any] = []
        for t in times:
            if t >= stop:
                rows.append([x, y, mp.mpf(0), mp.mpf(0)])
                continue
            low, high = mp.mpf(0), mp.tan(mp.mpf(phi) / 2)
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                low, high = (middle, high) if path(middle)[0] > t else (low, middle)
            rows.append(path(low if t else high)[1:])
    return np.array(rows, dtype=float)


def _path(m: Any, F: Any, f: Any, speed: Any, phi: Any) -> Callable[[Any], tuple[Any, ...]]:
    """Return a function of u that returns time, position and velocity."""
    from mpmath import mp

    m, F, f, speed, phi = map(mp.mpf, (m, F, f, speed, phi))
    k, start = f / F, mp.tan(phi / 2)
    C = 2 * speed * start ** (1 - k) / (1 + start * start)

    def at(u: Any) -> tuple[Any, ...]:
        def power(p: Any) -> Any:
            return (start**p - u**p) / p

        s = C * u ** (k - 1) * (1 + u * u) / 2
        angle = 2 * mp.atan(u)
        return (
            m * C / (2 * F) * (power(k - 1) + power(k + 1)),
            m * C * C / (4 * F) * (power(2 * k - 2) - power(2 * k + 2)),
            m * C * C / (2 * F) * (power(2 * k - 1) + power(2 * k + 1)),
            s * mp.cos(angle),
            s * mp.sin(angle),
        )

    return at


def certify_puck() -> Solution:
    """Return the default run of the model puck by the closed form; its error is the difference from DOP853."""
    from scipy.integrate import solve_ivp

    m, g, alpha, mu, v_x0, v_y0, stop = 1.0, 9.81, 0.4, 0.5, 2.0, 1.0, 2.5
    F, f = m * g * sin(alpha), mu * m * g * cos(alpha)
    times = np.linspace(0.0, stop, POINTS)
    # the force is along -y: the motion is that of the closed form turned by -90 degrees, and mirrored where v_x > 0
    along, across = -v_y0, v_x0
    phi = atan2(across, along)
    turned_motion = motion(m, F, f, hypot(along, across), phi, times.tolist())
    states = np.column_stack(
        [turned_motion[:, 1], 0.0 - turned_motion[:, 0], turned_motion[:, 3], 0.0 - turned_motion[:, 2]]
    )
    t_rest, *_ = rest(m, F, f, hypot(along, across), phi)

    def rates(t: float, y: np.ndarray) -> list[float]:
        v = hypot(y[2], y[3])
        return [y[2], y[3], -f / m * y[2] / v, -F / m - f / m * y[3] / v]

    moving_times = times[np.hypot(states[:, 2], states[:, 3]) > SLOW]
    second = solve_ivp(
        rates, (0.0, moving_times[-1]), [0.0, 0.0, v_x0, v_y0], "DOP853", moving_times, rtol=3e-14, atol=1e-16
    )
    difference = float(relative_errors(second.y.T, states[: len(moving_times)]).max())
    return Solution(
        times, states, [(t_rest, 0)], start_mode=1, method="closed form and DOP853", estimated_error=difference
    )


CLOSED_FORMS = {"puck": certify_puck}
