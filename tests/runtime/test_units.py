"""A motion does not depend on the units of length, time and mass."""

import pytest
from build_cache import build_once
from internal_steps import compute_step, prepared_run, start
from models import DOP853, scalar_class

from fmus.compiler.lowering import lowered_model
from fmus.compiler.model_lookup import MORE as MORE_FOLDER
from fmus.compiler.units import parse_unit
from fmus.runtime.variable_declarations import variables

MORE = ("forced", "joint", "sleds", "stacked")
ODE23, RODAS = 2, 5


def factor(unit, length, time, mass):
    """Return the number by which a value in a unit is multiplied, given the exponents of two of the base units."""
    dimension = parse_unit(unit)
    if dimension is None:  # "1"
        return 1.0
    return 2.0 ** (dimension.m * length + dimension.s * time + dimension.kg * mass)


def run(worker, fmus, name, method, *exponents):
    """Return the rows of all internal steps of a run in scaled units, in the units of the model."""
    model = scalar_class(name)()
    declarations = dict(variables(model))
    values = {
        variable: meaning.start * factor(meaning.unit, *exponents)
        for variable, meaning in declarations.items()
        if meaning.causality in ("parameter", "input") and meaning.type == "Real"
    }
    stop = model.stop_time * factor("s", *exponents)
    fmu = worker.instantiate((build_once("--more") if name in MORE else fmus) / f"{name}.fmu")
    fmu.begin(values | ({"solver.method": method} if method else {}), stop=stop)
    columns = [*model.states, "events.t_last"]
    factors = [factor(declarations[state].unit, *exponents) for state in model.states] + [factor("s", *exponents)]
    names = [*columns, *model.contacts, "events.count", "solver.steps", "solver.rejected", "solver.evaluations"]
    times, rows = fmu.follow(0.0, stop, names)
    fmu.free()
    return [
        [t / factors[-1], *(value / size for value, size in zip(row, factors, strict=False)), *row[len(factors) :]]
        for t, row in zip(times, rows, strict=True)
    ]


def first_steps(length):
    """Return end, rejections and position of the first steps of a bristle model, with lengths in another unit."""
    model = lowered_model(MORE_FOLDER / "lugre.py")()
    speeds_and_forces = {name: getattr(model, name) * length for name in ("F_s", "F_c", "v_s", "v_driver")}
    run = prepared_run(model, {"solver.method": DOP853, "solver.rtol": 1e-6, **speeds_and_forces})
    start(model, run, model.initial_state(0.0), 20.0)
    step, rows = run.solver.step, []
    for _ in range(20):
        assert compute_step(model, run) == 0
        rows.append((step.t1, step.n_rejected, step.y1_x / length))
    return rows


def test_a_proposal_beyond_the_range_of_numbers_shortens_the_step_alike_in_all_units():
    """The first step of stiff bristles is far too long for an explicit method, whose proposal overflows."""
    assert first_steps(2.0**40) == first_steps(1.0)


RUNS = [
    *(
        pytest.param("sleds", None, *exponents, marks=pytest.mark.slow)
        for exponents in [(-30, 0, 0), (20, 0, 0), (40, 0, 0), (0, 40, 0), (-40, -20, 40)]
    ),
    *(("coulomb", method, -30, 0, 0) for method in (None, ODE23, RODAS)),
    *(("pacejka", method, *exponents) for method in (None, ODE23) for exponents in [(-40, 0, 0), (0, 40, 0)]),
    *(pytest.param("forced", None, *exponents, marks=pytest.mark.slow) for exponents in [(20, 0, 0), (0, -40, 0)]),
    *(("stacked", None, *exponents) for exponents in [(20, 0, 0), (0, -40, 0)]),
    ("joint", None, 0, -40, 0),
    ("pendulum", None, -40, 30, -20),
    ("smd", ODE23, -40, 0, 40),
    ("stickslip", ODE23, 40, -40, 0),
]


@pytest.fixture(scope="module")
def unscaled_rows():
    """Rows of runs in the units of the model, by name and method."""
    return {}


@pytest.mark.parametrize(("name", "method", "length", "time", "mass"), RUNS)
def test_scaled_units_give_the_same_bits(worker, fmus, unscaled_rows, name, method, length, time, mass):
    """All exponents are of two, so that a change of units rounds nothing."""
    if (name, method) not in unscaled_rows:
        unscaled_rows[name, method] = run(worker, fmus, name, method, 0, 0, 0)
    assert run(worker, fmus, name, method, length, time, mass) == unscaled_rows[name, method]
