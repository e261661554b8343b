"""Friction laws with a narrow peak at zero slip are resolved by every method, where nominal_velocity declares its
width."""

from dataclasses import dataclass
from functools import cache
from math import exp

import numpy as np
import pytest
from build_cache import build_user_model
from models import DOP853, ODE23, ODE45, RODAS
from scipy.integrate import solve_ivp
from variants import campaign_after

# Reference motions of a block on a belt whose friction has a narrow peak at zero slip, by scipy.
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
        result = solve_ivp(
            rates, (t, stop), (x, slip), "DOP853", events=ends, rtol=3e-14, atol=1e-16, dense_output=True, **options
        )
        assert result.status >= 0
        pieces.append(result)
        t, (x, slip) = result.t[-1], result.y[:, -1]

        def position_at(time):
            return float(next(piece for piece in pieces if time <= piece.t[-1]).sol(time)[0])

        if result.status == 0:
            return position_at, stop, x, slip, mode
        if near and result.t_events[0].size:
            is_stuck = block.k * abs(x) <= block.f_s
            return position_at, t, x, 0.0, 0 if is_stuck else -int(np.sign(x))
        near = not near


NATIVE = ("--native", "--platform", "linux64")
TIMES = [0.05 * i for i in range(61)]
TOLERANCES = {ODE23: (1e-6, 1e-9), ODE45: (1e-6, 1e-9, 1e-12), DOP853: (1e-6, 1e-9, 1e-12), RODAS: (1e-6, 1e-9, 1e-12)}
ERROR = 10.0  # of a position, in multiples of the tolerance; the block moves by less than one metre

HEAD = '''"""Blocks with a narrow peak of the friction at zero slip."""

from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State, exp


class Narrow(Model):
    """Blocks on springs, on belts: m a = -k x - F_friction."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(100.0, "N/m", "stiffness", low=0.0)
    f_d = Parameter(2.0, "N", "sliding friction", low=0.0)
    f_s = Parameter(3.0, "N", "static friction", low=0.0)
'''
BLOCK = """
    v_b{0} = Parameter(0.0, "m/s", "speed of the belt")
    v_s{0} = Parameter(1e-3, "m/s", "width of the peak", above=0.0)
    x0{0} = Fixed(0.3, "m", "initial position")
    x{0} = State("m", "position", start=x0{0})
    v{0} = State("m/s", "speed", rate_of=x{0}{1})
    mode{0} = Mode()
    slip{0} = v{0} - v_b{0}
    ratio{0} = slip{0} / v_s{0}
    F{0} = Contact(
        "N", "friction", mode=mode{0}, slip=slip{0}, slide=f_d + (f_s - f_d) * exp(-ratio{0} * ratio{0}), hold=f_s
    )
    a{0} = Output("m/s2", "acceleration", (-k * x{0} - F{0}) / m, rate_of=v{0})
"""
WIDTH = ", nominal_velocity=v_s{}"
OTHER = """
    g = Parameter(1e-3, "m/s2", "acceleration of a driver")
    w = State("m/s", "speed of a driver", rate=g, nominal_velocity=v_s_1)
"""
BELT = """
    relative = Output("m/s", "speed relative to the belt", v - v_b)
"""
TEXTS = {
    "floor": (HEAD + BLOCK.format("", WIDTH.format(""))).replace("slip = v - v_b", "slip = v") + BELT,
    "belt": HEAD + BLOCK.format("", WIDTH.format("")),
    "two_widths": HEAD + BLOCK.format("_1", WIDTH.format("_1")) + BLOCK.format("_2", WIDTH.format("_2")),
    "other_state": HEAD + BLOCK.format("_1", "") + BLOCK.format("_2", "") + OTHER,
}


@cache
def reference(v_b, v_s, x0):
    """Return positions and numbers of events of a block."""
    return motion(Block(m=1.0, k=100.0, v_b=v_b, f_d=2.0, f_s=3.0, v_s=v_s, x0=x0), TIMES)


def assert_resolved(worker, folder, model, blocks):
    """Compare positions and numbers of events by all methods with the references of these (v_b, v_s, x0)."""
    (folder / f"{model}.py").write_text(TEXTS[model])
    fmu = worker.instantiate(build_user_model(folder / f"{model}.py", *NATIVE) / "native" / f"{model}.fmu")
    suffixes = [""] if len(blocks) == 1 else ["_1", "_2"]
    values = {
        f"{name}{suffix}": value
        for suffix, block in zip(suffixes, blocks, strict=True)
        for name, value in zip(("v_b", "v_s", "x0"), block, strict=True)
    }
    positions, events = zip(*(reference(*block) for block in blocks), strict=True)
    for method, tolerances in TOLERANCES.items():
        for rtol in tolerances:
            fmu.reset()
            fmu.begin({**values, "solver.method": method, "solver.rtol": rtol}, stop=TIMES[-1])
            rows = np.array(fmu.run(TIMES, ["events.count", *(f"x{suffix}" for suffix in suffixes)]))
            assert rows[:, 0].tolist() == np.sum(events, axis=0).tolist(), (method, rtol)
            assert np.max(np.abs(rows[:, 1:] - np.transpose(positions))) < ERROR * rtol, (method, rtol)
    fmu.free()


@pytest.mark.parametrize("v_s", campaign_after(1, [1e-3, 1e-2, 1e-4]))
@pytest.mark.parametrize(
    ("model", "v_b", "x0"), campaign_after(1, [("belt", 0.1, 0.0), ("belt", 0.0, 0.3), ("floor", 0.0, 0.3)])
)
def test_a_peak_of_any_width_is_resolved(worker, tmp_path, model, v_b, x0, v_s):
    assert_resolved(worker, tmp_path, model, [(v_b, v_s, x0)])


@pytest.mark.campaign
@pytest.mark.parametrize("model", ["two_widths", "other_state"])
def test_the_smallest_width_counts_for_every_slip(worker, tmp_path, model):
    """Of whatever state it is declared, and whatever contact it belongs to."""
    assert_resolved(worker, tmp_path, model, [(0.1, 1e-4, 0.0), (0.0, 1e-2, 0.3)])
