"""Model exchange call by call: what a solver only tries is no failure, what was set and cannot be used is."""

from math import inf, isnan, nan

import fmi3_by_hand
import pytest
from driver import Refused
from fmi3_by_hand import BREAK_AWAY, DRIVEN, DRIVER, at_event, sentence
from models import MODELS, PUSHED, declared, outputs, push

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
    with pytest.raises(Refused, match="fmi3UpdateDiscreteStates returned status 3"):
        at_event(fmu, t, [wild, wild, *states[2:]])
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


BAD = [(name, *bad) for name in PUSHED for bad in bad_settings(name)]


@pytest.mark.parametrize("in_event", [True, False], ids=["event mode", "continuous time"])
@pytest.mark.parametrize(("name", "values", "words"), BAD, ids=[f"{name}-{next(iter(v))}" for name, v, _ in BAD])
def test_a_value_that_cannot_be_used_ends_the_run_and_reset_recovers(moving, name, values, words, in_event):
    fmu, t, states = moving(name)
    fmu.place(t, states)
    expected = fmu.rates(), fmu.get(*outputs(name))
    if in_event:
        fmu.event()
    fmu.set(values)
    for _ in range(2):
        with pytest.raises(Refused):
            fmu.update() if in_event else fmu.rates()
    assert words in sentence(fmu)
    if in_event:
        fmu.go_on()
    fmu.place(t, states)
    for ask in (fmu.rates, fmu.indicators, fmu.where):
        with pytest.raises(Refused):
            ask()
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
    fmu = launch(name)
    fmu.reset()
    with pytest.raises(Refused, match="fmi3ExitInitializationMode returned status 3"):
        fmu.begin({"m": -1.0})
    assert "m = -1.0" in sentence(fmu)
    with pytest.raises(Refused):
        fmu.rates()
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
    assert fmu.update() == ["states"]  # what was set, and taken back
    assert fmu.rates() == before
    assert sentence(fmu) == ""
