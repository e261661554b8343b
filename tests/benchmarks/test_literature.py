"""Problems from the literature with known solutions."""

from functools import cache

import numpy as np
import pytest
from models import model_class

from benchmarks.literature import study
from benchmarks.literature.study import (
    BeltBlock,
    ChatteringOscillator,
    ChatteringOscillatorSign,
    SmoothedBeltBlock,
)
from harness.references import peer_solvers
from harness.simulation.embedded_model import EmbeddedModel, load_more_model, method_numbers

pytestmark = pytest.mark.campaign

BELT = (-0.2992525, -0.6308870)  # position in m and speed in m/s after 50 s, as published


@cache
def table():
    return list(study.solve_all())


@pytest.fixture
def rows(user_folder, monkeypatch):
    """Return rows(problem, solver) of the table, which is computed where FMUs exist."""
    monkeypatch.chdir(user_folder)
    return lambda problem, solver: [row for row in table() if (row.problem, row.solver) == (problem, solver)]


def test_the_reference_end_of_the_block_is_the_published_one():
    x, v = study.BLOCK
    assert (round(x, 7), round(v, 7)) == BELT


def test_the_reference_end_of_the_block_agrees_with_two_methods():
    for method, rtol in (("DOP853", 3e-14), ("Radau", 1e-11)):
        answer = peer_solvers.solve("scipy", method, BeltBlock(), np.array([0.0, 50.0]), rtol, 1e-3 * rtol)
        assert answer.states[-1] == pytest.approx(study.BLOCK_ON_BELT, abs=2e-11)


@pytest.mark.parametrize("method", ["ode23", "ode45", "dop853", "rodas"])
def test_every_method_of_the_runtime_reaches_the_end_of_the_block(rows, method):
    assert method in method_numbers(load_more_model("belt"))
    row = next(row for row in rows("block on a belt", study.RUNTIME) if row.method == method)
    assert row.error < 200 * row.rtol
    assert row.evaluations < 10_000


def test_the_block_sticks_and_slips_in_the_order_of_the_peer():
    run = EmbeddedModel.create(load_more_model("belt"), {}, "dop853", 1e-11)
    truth = peer_solvers.solve("scipy", "DOP853", BeltBlock(), np.array([0.0, 50.0]), 1e-12, 1e-15).events
    events = run.find_mode_changes(50.0)
    assert [mode for _, mode in events] == [mode for _, mode in truth] == [0, -1] * 4
    assert [t for t, _ in events] == pytest.approx([t for t, _ in truth], abs=1e-8)


def test_smoothing_loses_four_digits_at_more_cost_than_event_location(rows):
    smooth_row = next(row for row in rows("block on a belt", "scipy, arctan(1e6 v)") if row.method == "LSODA")
    located_row = next(row for row in rows("block on a belt", study.RUNTIME) if row.method == "ode45")
    assert smooth_row.error > 1e4 * located_row.error
    assert smooth_row.evaluations > located_row.evaluations


@pytest.mark.parametrize("method", method_numbers(model_class("coulomb")))
def test_every_method_of_the_runtime_stops_the_classic_problem_once_and_for_good(rows, method):
    row = next(row for row in rows("chattering classic", study.RUNTIME) if row.method == method)
    assert row.error < 10 * row.rtol
    assert row.evaluations < 200


def test_no_peer_finishes_with_the_plain_sign_law(rows):
    plain = rows("chattering classic", "scipy, plain sign(v)")
    assert [row.method for row in plain] == ["RK23", "RK45", "LSODA", "Radau"]
    assert all(row.failure and row.evaluations is None and np.isnan(row.error) for row in plain)


@pytest.mark.parametrize(
    ("problem", "bound"),
    {
        "stick-slip in closed form": 10,
        "stick-slip with LuGre friction": 10,
        "forced motion without stops": 10,
        "forced motion with stops": 10,
        "two sleds in a row": 10,
    }.items(),
)
def test_every_method_of_the_runtime_reaches_the_certified_answer(rows, problem, bound):
    runs = rows(problem, study.RUNTIME)
    assert {"ode23", "ode45", "dop853", "rodas"} <= {row.method for row in runs}
    assert all(row.error < bound * row.rtol for row in runs)


def test_lugre_is_right_to_nine_digits(rows):
    (row,) = [row for row in rows("stick-slip with LuGre friction", "this runtime") if row.method == "dop853"]
    assert row.error < 1e-10


def test_the_two_forms_of_each_problem_are_equivalent():
    for mode in (-1, 1):
        assert ChatteringOscillatorSign().rates(1)(0.0, (0.3, mode * 0.2)) == ChatteringOscillator().rates(mode)(
            0.0, (0.3, mode * 0.2)
        )
    smooth = SmoothedBeltBlock().rates(1)(3.0, (0.4, 0.2))[1]
    assert smooth == pytest.approx(BeltBlock().rates(1)(3.0, (0.4, 0.2))[1], abs=1e-5)
