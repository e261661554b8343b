"""Rests that begin and end within one integration step are found, and slips that nearly reach zero go on."""

import itertools
from functools import cache

import pytest
import short_sticks
from build_cache import build_user_model
from models import DOP853, EXACT, ODE23, ODE45, RADAU9, RODAS
from native_fmus import build_native_fmus

pytestmark = pytest.mark.slow

RESOLUTION = 100.0  # the slip is accurate to this multiple of the tolerance, relative to the largest slip of the phase
NATIVE = ("--native", "--platform", "linux64")
METHODS = [f"--method={label}" for label in ("ode23", "ode45", "dop853", "rodas", "radau9")]
MODES = {"belt": ["mode"], "sled": ["mode"], "stack": ["mode1", "mode2"]}


def native_fmu(model, folder):
    """Return the native FMU of a block on a belt, a stack or the shipped sled."""
    if model == "sled":
        return build_native_fmus() / "stickslip.fmu"
    file = folder / f"short_{model}.py"
    file.write_text({"belt": short_sticks.BELT, "stack": short_sticks.STACK}[model])
    return build_user_model(file, *NATIVE, *METHODS, optimised=True) / "native" / f"short_{model}.fmu"


@cache
def cases(model):
    """Return parameters and reference motions: static friction hardly above sliding friction, and chosen depths."""
    if model == "stack":
        return short_sticks.stacks(1.02, 3) + short_sticks.stacks(1.005, 5)
    randoms = short_sticks.belts if model == "belt" else short_sticks.sleds
    random_cases = [case for ratio in (1.02, 1.01, 1.005) for case in randoms(ratio, 10)]
    return random_cases + short_sticks.chosen(model, 40, depths=(1e-9, 1e-2))


def wrong_sets(worker, path, model, method, rtol):
    """Return the parameter sets with another number of events or other modes than the reference."""
    wrong = []
    fmu = worker.instantiate(path)
    for parameters, motion in cases(model):
        points = short_sticks.checkpoints(motion, parameters.period, RESOLUTION * rtol)
        fmu.reset()
        fmu.begin({**parameters.values(), "solver.method": method, "solver.rtol": rtol}, stop=motion.stop)
        rows = fmu.run([0.0, *(t for t, _, _ in points)], ["events.count", *MODES[model]])[1:]
        for (t, n_events, modes), (n_found, *present) in zip(points, rows, strict=True):
            if n_found != n_events or (modes and tuple(present) != modes):
                wrong.append((t, n_events, n_found, parameters))
                break
    fmu.free()
    return wrong


@pytest.mark.parametrize("rtol", [1e-6, 1e-11])
@pytest.mark.parametrize(
    ("model", "method"),
    [*itertools.product(MODES, [ODE23, ODE45, DOP853, RODAS]), ("belt", RADAU9), ("stack", RADAU9)],
)
def test_every_rest_deeper_than_the_error_is_found(worker, tmp_path, model, method, rtol):
    assert wrong_sets(worker, native_fmu(model, tmp_path), model, method, rtol) == []


def test_the_closed_form_finds_every_rest(worker, tmp_path):
    assert wrong_sets(worker, native_fmu("sled", tmp_path), "sled", EXACT, 1e-11) == []


@pytest.mark.parametrize("method", [ODE23, ODE45, DOP853, RODAS, RADAU9])
def test_a_slip_that_touches_zero_on_a_belt_goes_on(worker, tmp_path, method):
    """Static and sliding friction are equal: the block rides along once, and its slip then touches zero in each
    period."""
    fmu, counts = worker.instantiate(native_fmu("belt", tmp_path)), []
    for rtol in (1e-6, 1e-9):
        for parameters, motion in short_sticks.touches(10):
            fmu.reset()
            fmu.begin({**parameters.values(), "solver.method": method, "solver.rtol": rtol}, stop=motion.stop)
            counts.append(fmu.run([0.0, motion.stop], ["events.count"])[-1][0])
    fmu.free()
    assert counts == [2] * 20
