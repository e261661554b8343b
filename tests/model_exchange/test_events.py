"""Model exchange call by call: the effects of events, and that nothing happens without an event."""

from math import isfinite

import pytest
from models import EXACT, MODELS, SIGN, THRESHOLD, declarations_of

from tests.model_exchange.model_exchange_client import (
    BREAKAWAY_TIME,
    DRIVER,
    HOLD,
    SLIDE,
    G,
    K,
    M,
    handle_event_at,
    single_error,
)


def test_the_sled_breaks_away_slides_and_sticks_again(launch):
    fmu = launch("stickslip")
    assert fmu.update_discrete_states() == []
    fmu.enter_continuous_time()
    assert fmu.indicators() == pytest.approx([1.0, HOLD])
    assert fmu.rates() == [0.0, 0.0, DRIVER]

    before = BREAKAWAY_TIME * (1.0 - 1e-12)
    assert handle_event_at(fmu, before, [0.0, 0.0, DRIVER * before]) == []  # too early: nothing happens
    fmu.enter_continuous_time()
    assert fmu.get("mode", "events.count") == [0, 0]
    to_rest, to_break_away = fmu.indicators()
    assert to_rest == 1.0
    assert 0.0 < to_break_away < 1e-9

    after = BREAKAWAY_TIME * (1.0 + 1e-12)
    fmu.set_point(after, [0.0, 0.0, DRIVER * after])
    assert fmu.indicators()[1] < 0.0
    assert fmu.rates() == [0.0, 0.0, DRIVER]  # the old mode is valid until the event is handled
    fmu.enter_event_mode()
    assert fmu.update_discrete_states() == ["states"]  # the right-hand side changes, so the solver must restart
    assert fmu.update_discrete_states() == []  # a slip that just began does not end
    fmu.enter_continuous_time()
    assert fmu.get("mode", "events.count", "events.t_last") == [1, 1, after]
    assert fmu.rates() == pytest.approx([0.0, (HOLD - SLIDE) / M, DRIVER])
    to_rest, to_break_away = fmu.indicators()
    assert 0.0 < to_rest < 1e-200  # zero would be a root that remains
    assert to_break_away == 1.0

    fmu.set_point(4.6, [0.05, 0.2, DRIVER * 4.6])
    assert fmu.indicators() == [0.2, 1.0]
    assert fmu.rates()[1] == pytest.approx((K * (DRIVER * 4.6 - 0.05) - SLIDE) / M)

    assert handle_event_at(fmu, 4.8, [0.1, -1e-9, DRIVER * 4.8]) == ["states"]
    assert fmu.get_states() == [0.1, 0.0, DRIVER * 4.8]
    assert fmu.update_discrete_states() == []
    fmu.enter_continuous_time()
    assert fmu.get("mode", "events.count", "events.t_last") == [0, 2, 4.8]
    assert fmu.rates() == [0.0, 0.0, DRIVER]
    assert fmu.indicators() == pytest.approx([1.0, HOLD - K * (DRIVER * 4.8 - 0.1)])


@pytest.mark.parametrize("values", [{}, {"mu_d": 0.9}, {"mu_d": 0.0}, {"g": 0.0}], ids=str)
def test_no_indicator_is_zero_after_event_handling(launch, values):
    """A solver would take it for a root that remains (CVODE: root found at and very near t)."""
    fmu = launch("stickslip", values)
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    begin = 0.0 if values.get("g") == 0.0 else BREAKAWAY_TIME * (1.0 + 1e-12)
    for t, x, v in ((begin, 0.0, 0.0), (begin + 0.5, 0.02, -1e-15), (begin + 0.6, 0.02, 0.0)):
        handle_event_at(fmu, t, [x, v, DRIVER * t])
        fmu.enter_continuous_time()
        assert all(indicator > 0.0 for indicator in fmu.indicators())


@pytest.mark.parametrize("ulps", [*range(-9, 10), 300])
def test_an_event_is_due_once_its_indicator_is_not_positive(launch, ulps):
    """A solver that stops at the root or slightly beyond never stops in vain. An event a few units in the last place
    too early also acts, because the load is about to exceed the limit."""
    values = {"m": 1.0, "g": 1.0, "mu_s": 0.5, "mu_d": 0.25, "k": 1.0, "v_driver": 1.0}
    fmu = launch("stickslip", values)
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    t_limit = 0.5 * (1.0 + ulps * 2.0**-52)
    fmu.set_point(t_limit, [0.0, 0.0, t_limit])
    to_break_away = fmu.indicators()[1]
    assert to_break_away > 0.0 or ulps > 0
    assert to_break_away <= 0.0 or ulps < 300  # beyond the limit by more than the rounding of its terms
    assert handle_event_at(fmu, t_limit, [0.0, 0.0, t_limit]) == ["states"]
    assert fmu.get("mode") == 1
    fmu.enter_continuous_time()
    assert handle_event_at(fmu, 1.0, [0.75, 1e-300, 1.0]) == []
    assert fmu.get("mode") == 1  # it barely moves, but it does
    fmu.enter_continuous_time()
    assert handle_event_at(fmu, 1.0, [0.9, 0.0, 1.0]) == ["states"]
    assert fmu.get("mode", "events.count") == [0, 2]


@pytest.mark.parametrize("direction", [1, -1])
def test_a_mass_that_friction_cannot_hold_reverses_without_a_stop(launch, direction):
    """The mass with Coulomb friction, at large displacement: one event from sliding one way to sliding the other."""
    fmu = launch("coulomb", {"x0": 0.1 * direction})
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    assert fmu.get("mode") == -direction
    assert handle_event_at(fmu, 0.25, [-0.09 * direction, 1e-12 * direction]) == ["states"]
    assert fmu.get("mode", "events.count") == [direction, 1]
    assert fmu.get_states() == [-0.09 * direction, 0.0]
    assert fmu.rates()[1] == pytest.approx(direction * (157.9 * 0.09 - 0.5))
    fmu.enter_continuous_time()
    assert handle_event_at(fmu, 0.5, [0.003 * direction, -1e-12 * direction]) == ["states"]
    assert fmu.get("mode", "events.count") == [0, 2]


@pytest.mark.parametrize(("variable", "value"), [("mu_s", 0.1), ("k", 5000.0), ("F_ext", 200.0), ("g", 1.0)])
def test_a_change_in_event_mode_can_set_a_stuck_sled_free(launch, variable, value):
    fmu = launch("stickslip", {"mu_d": 0.05})
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    fmu.set_point(2.0, [0.0, 0.0, DRIVER * 2.0])
    fmu.enter_event_mode()
    fmu.set({variable: value})
    assert fmu.update_discrete_states() == ["states"]
    assert fmu.get("mode", "events.count", "events.t_last") == [1, 1, 2.0]
    settings = {"k": K, "mu_d": 0.05, "g": G, "F_ext": 0.0, variable: value}
    net = settings["F_ext"] + settings["k"] * DRIVER * 2.0 - settings["mu_d"] * M * settings["g"]
    assert fmu.rates()[1] == pytest.approx(net / M)


def test_a_change_in_continuous_time_takes_effect_at_the_event(launch):
    """An input keeps growing between two evaluations: the motion stays smooth, and the indicator changes."""
    fmu = launch("stickslip")
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    fmu.set_point(2.0, [0.0, 0.0, DRIVER * 2.0])
    for force in (20.0, 200.0):
        fmu.set({"F_ext": force})
        assert fmu.rates() == [0.0, 0.0, DRIVER]
        assert fmu.indicators() == pytest.approx([1.0, HOLD - force - K * DRIVER * 2.0])
        assert fmu.get("mode") == 0
    fmu.enter_event_mode()
    fmu.update_discrete_states()
    assert fmu.get("mode") == 1


def test_a_changed_driver_speed_causes_no_jump(launch):
    fmu = launch("stickslip")
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    fmu.set_point(2.0, [0.0, 0.0, DRIVER * 2.0])
    before = fmu.get("x", "v", "x_driver", "F_spring", "energy")
    fmu.enter_event_mode()
    fmu.set({"v_driver": -1.0})
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    assert fmu.get("x", "v", "x_driver", "F_spring", "energy") == before
    assert fmu.rates() == [0.0, 0.0, -1.0]


@pytest.mark.parametrize("name", MODELS)
def test_a_value_set_since_the_last_event_restarts_the_solver(launch, name):
    """Some importers restart only if a state has jumped, and set an input just before the event."""
    fmu = launch(name)
    assert fmu.update_discrete_states() == []
    fmu.enter_continuous_time()
    for value in (0.25, 1.0):
        fmu.set({"m": value})
        fmu.rates()
        fmu.enter_event_mode()
        assert fmu.update_discrete_states() == ["states"]
        assert fmu.update_discrete_states() == []
        fmu.set({"m": 2.0 * value})
        assert fmu.update_discrete_states() == ["states"]
        fmu.enter_continuous_time()
        fmu.enter_event_mode()
        assert fmu.update_discrete_states() == []
        fmu.enter_continuous_time()


@pytest.mark.parametrize(("name", "law"), [("coulomb", SIGN), ("pendulum", SIGN), ("stickslip", THRESHOLD)])
def test_the_other_laws_have_no_event_indicators_and_no_method(launch, name, law):
    values = {"friction": law}
    if any(value == EXACT for _, value, _ in declarations_of(name)["solver.method"].items):
        values["solver.method"] = EXACT
    fmu = launch(name, values)
    assert fmu.update_discrete_states() == []
    fmu.enter_continuous_time()
    assert fmu.indicators() == [1.0, 1.0]
    x, *rest = fmu.get_states()
    assert handle_event_at(fmu, 1.0, [x, 0.0, *rest[1:]]) == []
    assert fmu.get("events.count") == 0
    assert all(isfinite(rate) for rate in fmu.rates())
    assert single_error(fmu) == ""
