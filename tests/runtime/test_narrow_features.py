"""Friction laws with a narrow peak at zero slip are resolved by every method, where nominal_velocity declares its
width."""

from functools import cache

import numpy as np
import pytest
from build_cache import build_user_model
from models import DOP853, ODE23, ODE45, RODAS
from narrow_friction import Block, motion

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


@pytest.mark.parametrize("v_s", [1e-3, *(pytest.param(v_s, marks=pytest.mark.slow) for v_s in (1e-2, 1e-4))])
@pytest.mark.parametrize(("model", "v_b", "x0"), [("floor", 0.0, 0.3), ("belt", 0.0, 0.3), ("belt", 0.1, 0.0)])
def test_a_peak_of_any_width_is_resolved(worker, tmp_path, model, v_b, x0, v_s):
    assert_resolved(worker, tmp_path, model, [(v_b, v_s, x0)])


@pytest.mark.slow
@pytest.mark.parametrize("model", ["two_widths", "other_state"])
def test_the_smallest_width_counts_for_every_slip(worker, tmp_path, model):
    """Of whatever state it is declared, and whatever contact it belongs to."""
    assert_resolved(worker, tmp_path, model, [(0.1, 1e-4, 0.0), (0.0, 1e-2, 0.3)])
