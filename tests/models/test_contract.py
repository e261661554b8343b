"""The names, units, bounds and defaults that users rely on, written out independently."""

from math import radians

import pytest
from fmpy import read_model_description
from models import MODELS, declarations_of, model_class

from fmus.runtime.codes import OUT_OF_RANGE
from fmus.runtime.messages import value_message
from fmus.runtime.variable_declarations import Enumeration, Setting, VariableOwner

POUND, INCH = 0.45359237, 0.0254
SLED = {"m": 12.5, "k": 742.5, "mu_s": 0.9, "mu_d": 0.6, "g": 9.81, "v_driver": 0.034}
TUNABLE = {
    "smd": {"m": 1.0, "k": 157.9, "c": 2.0},
    "coulomb": {"m": 1.0, "k": 157.9, "c": 0.0, "f": 0.5},
    "stickslip": {**SLED, "eps": 1e-7},
    "pacejka": {**SLED, "x_m": 0.01},
    "pendulum": {
        "m": 0.46 * POUND,
        "a": 3.7 * INCH,
        "J_G": 1.5 * POUND * INCH**2,
        "g": 386 * INCH,
        "mu": 0.1,
        "r": 0.25 * INCH,
    },
}
FIXED_VALUES = {
    "smd": {"x0": 0.1, "v0": 0.0},
    "coulomb": {"x0": 0.1, "v0": 0.0},
    "stickslip": {"x0": 0.0, "v0": 0.0},
    "pacejka": {"x0": 0.0, "v0": 0.0},
    "pendulum": {"theta0": radians(10.02), "omega0": 0.0},
}
OUTPUTS = {
    "smd": "x v a F_spring F_damper energy",
    "coulomb": "x v a F_spring F_friction energy mode",
    "stickslip": "x v a x_driver F_spring F_friction energy mode",
    "pacejka": "x v a x_driver F_spring F_friction energy",
    "pendulum": "theta omega alpha T_friction energy mode",
}
STOP = {"smd": 4.0, "coulomb": 4.0, "stickslip": 16.0, "pacejka": 16.0, "pendulum": 5.0}
METHODS = {"exact": 1, "ode23": 2, "ode45": 3, "dop853": 4, "rodas": 5, "radau9": 6}
UNITS = {
    **dict.fromkeys(("m", "solver"), "kg"),
    **dict.fromkeys(("x", "x0", "x_driver", "a_pin", "r"), "m"),
    **dict.fromkeys(("v", "v0", "v_driver", "eps", "x_m"), "m/s"),
    **dict.fromkeys(("F_ext", "f", "F_spring", "F_damper", "F_friction"), "N"),
    **dict.fromkeys(("T_ext", "T_friction"), "N.m"),
    **dict.fromkeys(("theta", "theta0"), "rad"),
    **dict.fromkeys(("omega", "omega0"), "rad/s"),
    **dict.fromkeys(("mu", "mu_s", "mu_d", "solver.rtol"), "1"),
    **dict.fromkeys(("solver.h", "solver.h_max", "solver.t_next", "events.t_last"), "s"),
    **{"k": "N/m", "c": "N.s/m", "alpha": "rad/s2", "energy": "J", "J_G": "kg.m2", "g": "m/s2"},
}


def starts(name, kind):
    return {v: d.start for v, d in declarations_of(name).items() if kind(d) and "." not in v and not d.items}


def test_there_are_five_models():
    """A new model gets its own contract."""
    assert {*TUNABLE} <= {*MODELS}


@pytest.mark.parametrize("name", TUNABLE)
def test_parameters_and_inputs_have_their_names_and_defaults(name):
    assert starts(name, lambda d: (d.causality, d.variability) == ("parameter", "tunable")) == pytest.approx(
        TUNABLE[name], rel=1e-15
    )
    assert starts(name, lambda d: d.variability == "fixed") == pytest.approx(FIXED_VALUES[name], rel=1e-15)
    force = "T_ext" if name == "pendulum" else "F_ext"
    assert starts(name, lambda d: d.causality == "input") == {force: 0.0}
    assert model_class(name).stop_time == STOP[name]


@pytest.mark.parametrize("name", OUTPUTS)
def test_outputs_have_their_names(name):
    assert [v for v, d in declarations_of(name).items() if d.causality == "output"] == OUTPUTS[name].split()


@pytest.mark.parametrize("name", TUNABLE)
def test_the_solver_has_its_settings_and_counters(name):
    settings = {
        v: d.start
        for v, d in declarations_of(name).items()
        if v.startswith("solver.") and d.causality in ("parameter", "input")
    }
    default = {"pacejka": "radau9", "pendulum": "dop853"}.get(name, "exact")
    assert settings == {"solver.method": METHODS[default], "solver.rtol": 0.0, "solver.atol": 0.0, "solver.h_max": 0.0}
    for label, value, _ in declarations_of(name)["solver.method"].items:
        assert METHODS[label] == value
    counts = [v for v, d in declarations_of(name).items() if d.causality == "local"]
    expected = "solver.steps solver.rejected solver.evaluations solver.h solver.t_next events.count events.t_last"
    assert sorted(counts) == sorted(expected.split())


def test_each_model_offers_its_friction_laws():
    laws = {name: declarations_of(name)["friction"] for name in TUNABLE if "friction" in declarations_of(name)}
    items = {name: [item[:2] for item in law.items] for name, law in laws.items()}
    two_laws = [("hybrid", 1), ("sign", 2)]
    assert items == {"coulomb": two_laws, "pendulum": two_laws, "stickslip": [("hybrid", 1), ("threshold", 3)]}
    assert all(law.start == 1 for law in laws.values())
    assert [item[:2] for item in declarations_of("pendulum")["pin_load"].items] == [("weight", 1), ("reaction", 2)]


@pytest.mark.parametrize("name", TUNABLE)
def test_units_match_the_quantities(name):
    special = {"a": "m" if name == "pendulum" else "m/s2", "solver.atol": declarations_of(name)["solver.atol"].unit}
    for v, d in declarations_of(name).items():
        if d.type == "Real":
            assert d.unit == {**UNITS, **special}[v], v
        assert d.text
        if d.unit.startswith("rad"):
            assert d.display.startswith("deg")


@pytest.mark.parametrize("name", TUNABLE)
def test_masses_are_positive_and_all_start_values_are_in_range(name):
    assert declarations_of(name)["m"].above == 0.0
    assert not declarations_of(name)["m"].accepts(0.0)
    assert all(d.accepts(d.start) for d in declarations_of(name).values() if d.causality in ("parameter", "input"))


def test_a_declaration_states_its_allowed_range():
    class Sample(VariableOwner):
        free = Setting(1.0, "1", "a number")
        mass = Setting(1.0, "kg", "mass", above=0.0)
        share = Setting(0.5, "1", "share", low=0.0, below=1.0)
        kind = Enumeration(2, "kind", (("one", 1, "first"), ("two", 2, "second")))

    assert vars(Sample()) == {"free": 1.0, "mass": 1.0, "share": 0.5, "kind": 2}
    message = value_message(OUT_OF_RANGE, "mass", Sample.mass, -2.0)
    assert message == "mass = -2.0 kg is refused: mass must be above 0.0 kg"
    assert Sample.share.allowed_range == "at least 0.0 and below 1.0"
    assert Sample.kind.allowed_range == "one of 1 (one), 2 (two)"
    assert Sample.free.allowed_range == "a finite number"
    inf = float("inf")
    verdicts = {Sample.free: (inf, -inf, inf - inf), Sample.mass: (0.0, -1e-300), Sample.share: (-1e-300, 1.0)}
    assert not any(d.accepts(value) for d, values in verdicts.items() for value in values)
    assert Sample.share.accepts(0.0)
    assert Sample.kind.accepts(2)
    assert not Sample.kind.accepts(3)


@pytest.mark.parametrize("name", TUNABLE)
def test_a_rate_names_its_state(fmus, name):
    variables = {v.name: v for v in read_model_description(fmus / f"{name}.fmu").modelVariables}
    states = {v.name: v.derivative.name for v in variables.values() if v.derivative is not None}
    assert states == ({"omega": "theta", "alpha": "omega"} if name == "pendulum" else {"v": "x", "a": "v"})
