"""Reference motions of a block on a belt whose friction has a narrow peak at zero slip, by scipy.

The slip is integrated itself, in steps of a fraction of the width while it is small, so that no step passes the peak.
While it is large, friction is constant, so that the last step may reach into the peak.  Nothing here is shared with the
code under test.
"""

from dataclasses import dataclass
from math import exp

import numpy as np
from scipy.integrate import solve_ivp

NEAR = 7.0  # widths; the peak is below the rounding error beyond


@dataclass
class Block:
    """Parameters: m a = -k x - F, F = +-(f_d + (f_s - f_d) exp(-(slip / v_s)^2))."""

    m: float
    k: float
    v_b: float
    f_d: float
    f_s: float
    v_s: float
    x0: float

    def friction(self, slip):
        """Return the magnitude of the friction force while the block slides."""
        return self.f_d + (self.f_s - self.f_d) * exp(-((slip / self.v_s) ** 2))


def motion(block, times):
    """Return the positions at these times, and the number of changes of mode up to each; the block starts at rest."""
    t, x, slip, stop = 0.0, block.x0, -block.v_b, times[-1]
    mode = int(np.sign(slip))
    if mode == 0:
        mode = 0 if block.k * abs(x) <= block.f_s else -int(np.sign(x))
    positions, events, n_events = [], [], 0
    while t < stop:
        if mode == 0:
            places_until, t, x, mode = rest(block, t, x, stop)
            slip = 0.0
        else:
            places_until, t, x, slip, mode = phase(block, mode, t, x, slip, stop)
        for time in times[len(positions) :]:
            if time > t or (time == t and t < stop):
                break
            positions.append(places_until(time))
            events.append(n_events)
        n_events += 1
    return positions, events


def rest(block, t, x, stop):
    """Let the block ride along up to the break-away; return positions, end, position and mode there."""
    end = stop
    if block.v_b != 0.0:
        end = t + (np.sign(block.v_b) * block.f_s / block.k - x) / block.v_b
    mode = -int(np.sign(block.v_b))
    end = min(end, stop)
    return (lambda time: x + block.v_b * (time - t)), end, x + block.v_b * (end - t), mode


def phase(block, mode, t, x, slip, stop):
    """Let the block slide up to the next standstill; return positions, end, position, slip and mode there."""

    def rates(_, y):
        force = block.friction(y[1]) if near else block.f_d
        return y[1] + block.v_b, (-block.k * y[0] - mode * force) / block.m

    def passes(value, direction):
        def event(_, y):
            return mode * y[1] - value

        event.terminal, event.direction = True, direction
        return event

    limit, pieces = NEAR * block.v_s, []
    near = mode * slip < limit
    while True:
        largest = (abs(block.k * x) + block.f_s) / block.m + block.v_s
        options = {"max_step": 0.1 * block.v_s / largest} if near else {}
        ends = [passes(0.0, -1), passes(limit * 1.01, 1)] if near else [passes(limit, -1)]
        done = solve_ivp(
            rates, (t, stop), (x, slip), "DOP853", events=ends, rtol=3e-14, atol=1e-16, dense_output=True, **options
        )
        assert done.status >= 0
        pieces.append(done)
        t, (x, slip) = done.t[-1], done.y[:, -1]

        def position_at(time):
            return float(next(one for one in pieces if time <= one.t[-1]).sol(time)[0])

        if done.status == 0:
            return position_at, stop, x, slip, mode
        if near and done.t_events[0].size:
            held = block.k * abs(x) <= block.f_s
            return position_at, t, x, 0.0, 0 if held else -int(np.sign(x))
        near = not near
