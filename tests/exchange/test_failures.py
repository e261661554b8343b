"""Model exchange call by call: what a solver only tries is no failure, what was set and cannot be used is."""

from math import inf, isnan, nan

import fmi3_by_hand
import pytest
from fmi3_by_hand import BREAK_AWAY, DRIVEN, DRIVER, at_event, sentence
from models import MODELS, declared, outputs, push

fmus, worker, _workers, launch, moving = fmi3_by_hand.FIXTURES
EVERY_MODEL = pytest.mark.parametrize("name", MODELS)


@EVERY_MODEL
@pytest.mark.parametrize("wild", [nan, inf, -inf, 1e308, -1e308, 1e200])
def test_a_wild_trial_state_is_no_failure(moving, name, wild):
    fmu, t, states = moving(name)
    fmu.place(t, states)
    before = fmu.rates(), fmu.indicators(), fmu.get(*outputs(name))
    for trial in ([wild] * 2, [states[0], wild], [wild, states[1]]):
        fmu.place(t, trial + states[2:])
        rates, _ = fmu.rates(), fmu.indicators()
        assert not isnan(wild) or any(isnan(rate) for rate in rates)
        fmu.get(*declared(name))
    fmu.place(nan, states)
    fmu.rates()
    fmu.indicators()
    fmu.place(t, states)
    assert (fmu.rates(), fmu.indicators(), fmu.get(*outputs(name))) == before
    assert sentence(fmu) == ""
    fmu.event()
    assert fmu.update() == []


@EVERY_MODEL
@pytest.mark.parametrize("wild", [nan, inf, 1e300])
def test_an_event_at_no_place_ends_the_run(moving, name, wild):
    """The importer has come there for good; a saved state brings it back."""
    fmu, t, states = moving(name)
    fmu.place(t, states)
    expected = fmu.rates()
    state = fmu.save()
    assert at_event(fmu, t, [wild, wild, *states[2:]]) == ["terminate"]
    assert "range of numbers" in sentence(fmu)
    fmu.restore(state)
    assert fmu.rates() == expected
    fmu.event()
    assert fmu.update() == []


def bad_settings(name):
    """Values that cannot be used once the run goes on, and what the sentence names."""
    force, _ = push(name)
    x = outputs(name)[0]
    yield {force: nan}, f"{force} = nan"
    yield {"m": 0.0}, "m = 0.0"
    yield {f"{x}0": 0.5}, "fixed"
    if name in DRIVEN:
        yield {"mu_d": 2.0}, "mu_d"


BAD = [(name, *bad) for name in MODELS for bad in bad_settings(name)]


@pytest.mark.parametrize("in_event", [True, False], ids=["event mode", "continuous time"])
@pytest.mark.parametrize(("name", "values", "words"), BAD, ids=[f"{name}-{next(iter(v))}" for name, v, _ in BAD])
def test_a_value_that_cannot_be_used_ends_the_run_and_reset_recovers(moving, name, values, words, in_event):
    fmu, t, states = moving(name)
    fmu.place(t, states)
    expected = fmu.rates(), fmu.get(*outputs(name))
    if in_event:
        fmu.event()
    fmu.set(values)
    if not in_event:
        assert all(isnan(rate) for rate in fmu.rates())
        fmu.event()
    assert fmu.update() == ["terminate"]
    assert fmu.update() == ["terminate"]
    assert words in sentence(fmu)
    fmu.place(t, states)
    assert all(isnan(rate) for rate in fmu.rates())
    assert all(isnan(indicator) for indicator in fmu.indicators())
    reals = [v for v in outputs(name) if declared(name)[v].type == "Real"]
    assert all(isnan(value) for value in fmu.get(*reals))
    assert sentence(fmu) == ""  # once is enough
    fmu.reset()
    fmu.begin()
    assert fmu.update() == []
    fmu.go_on()
    if name == "stickslip":
        at_event(fmu, BREAK_AWAY * 1.01, [0.0, 0.0, DRIVER * BREAK_AWAY * 1.01])
        fmu.go_on()
    fmu.place(t, states)
    assert (fmu.rates(), fmu.get(*outputs(name))) == expected
    assert sentence(fmu) == ""


@EVERY_MODEL
def test_a_bad_start_ends_the_run_before_it_begins(launch, name):
    fmu = launch(name, {"m": -1.0})
    assert fmu.update() == ["terminate"]
    assert "m = -1.0" in sentence(fmu)
    assert all(isnan(rate) for rate in fmu.rates())
    fmu.reset()
    assert fmu.begin().update() == []


@EVERY_MODEL
def test_a_bad_value_may_be_mended_before_it_is_used(moving, name):
    fmu, t, states = moving(name)
    force, _ = push(name)
    fmu.place(t, states)
    before = fmu.rates()
    fmu.event()
    fmu.set({force: nan})
    fmu.set({force: 0.0})
    assert fmu.update() == []
    assert fmu.rates() == before
    assert sentence(fmu) == ""
