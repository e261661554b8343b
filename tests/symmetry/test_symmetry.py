"""A motion does not depend on its start time, the units, a mirror, the order of declarations, the frame and the largest
step."""

import random
from contextlib import redirect_stderr
from io import StringIO

import pytest
from variants import campaign_after

from benchmarks.symmetry.builds import FMI3, NATIVE
from benchmarks.symmetry.changes import FRAME, LONG, MIRROR, REVOLUTIONS, TIME, UNITS
from benchmarks.symmetry.command import describe
from benchmarks.symmetry.study import Options, list_choices
from tests.symmetry.symmetry_models import KINDS, LABELS, examine, open_model

FEW = {"max_steps": 200, "starts": (1e6,), "scales": ((40, 20, 10),)}
MORE = {
    "max_steps": 1000,
    "starts": (1.0, 1e3, 1e6, -1e3),
    "scales": ((0, -40, 0), (0, 40, 0), (0, 0, 40), (40, 20, 10)),
}
FEW_MODELS = {
    "coulomb": ("exact", "ode45"),
    "stickslip": ("exact", "ode23"),
    "pendulum": ("dop853",),
    "pacejka": ("radau9",),
    "belt": ("rodas",),
    "crank": ("ode45",),
}
PERIODIC = {"stickslip": 1e5, "joint": 700.0, "forced": 300.0, "sleds": 1000.0}  # duration in s
HAVE_ANGLES = ("pendulum",)  # set by a parameter; test_revolutions.py has further models
HAVE_NONE = {  # no mirror image: a constant of one sign, a number as start value, or a slip in a plane without a sign
    UNITS: ("servo",),  # a table holds numbers with units
    MIRROR: ("bumper", "clutch", "forced", "joint", "lift", "puck", "viscous_pendulum"),
    FRAME: ("spring",),  # no state is a velocity
}


@pytest.mark.parametrize("label", campaign_after(1, FEW_MODELS))
def test_a_motion_depends_on_no_time_unit_sign_order_or_frame(label):
    examined_runs, differences = examine(label, methods=FEW_MODELS[label], **FEW)
    assert {*examined_runs} == {kind for kind in KINDS if kind != REVOLUTIONS or label in HAVE_ANGLES}
    assert not differences


def check_all_changes(label, **options):
    examined_runs, differences = examine(label, **options)
    expected = {kind for kind in KINDS if label not in HAVE_NONE.get(kind, ())}
    assert {*examined_runs} == (expected if label in HAVE_ANGLES else expected - {REVOLUTIONS})
    assert not differences


@pytest.mark.campaign
@pytest.mark.parametrize("label", ["smd", "stacked", "servo"])
def test_no_motion_of_a_further_model_depends_on_them(label):
    check_all_changes(label, methods=("ode45",), **FEW)


@pytest.mark.campaign
@pytest.mark.parametrize("label", LABELS)
def test_no_motion_of_any_method_and_law_depends_on_them(label):
    check_all_changes(label, **MORE)


@pytest.mark.campaign
@pytest.mark.parametrize("backend", [NATIVE, FMI3])
@pytest.mark.parametrize("label", FEW_MODELS)
def test_native_motions_depend_on_no_time_unit_or_sign(label, backend):
    kinds = (TIME, UNITS, MIRROR)
    examined_runs, differences = examine(label, backend, kinds, FEW_MODELS[label], **MORE)
    assert {*examined_runs} == {*kinds}
    assert not differences


@pytest.mark.campaign
@pytest.mark.parametrize("label", PERIODIC)
def test_every_period_of_a_long_run_has_the_same_events(label):
    examined_runs, differences = examine(
        label, NATIVE if label == "stickslip" else "python", (LONG,), long_run=PERIODIC[label]
    )
    assert {*examined_runs} == {LONG}
    assert not differences


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(60))
def test_random_motions_depend_on_none_of_them(seed):
    """Of runs with parameters that differ from the defaults by random factors, and with random inputs."""
    rng = random.Random(seed)
    label, method = rng.choice([(label, method) for label, methods in FEW_MODELS.items() for method in methods])
    model = open_model(label)
    values = rng.choice(list_choices(model.runs, [method]))
    for name, variable in model.runs.variables.items():
        if variable.causality in ("parameter", "input") and name in model.runs.exponents and "." not in name:
            values[name] = model.runs.start_value(name) * rng.uniform(0.8, 1.25)
    scale = tuple(rng.randint(-40, 40) for _ in range(3))
    model.options = Options(max_steps=400, starts=(rng.uniform(-1e6, 1e6),), scales=(scale,))
    with redirect_stderr(StringIO()):
        outcomes = list(model.examine(values))
    if not {TIME, UNITS} <= {outcome.kind for outcome in outcomes if not outcome.reason}:
        pytest.skip("a rule of the model refuses the values")
    assert not [describe(outcome) for outcome in outcomes if outcome.difference]
