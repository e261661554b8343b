"""Model exchange call by call: invalid trial states of a solver are no failure, invalid settings are refused."""

from math import inf, isnan, nan

import pytest
from models import MODELS, declarations_of, model_class, outputs, push, runtime
from worker_client import FmiError

from fmus.compiler.lowering import model_exchange_run
from fmus.runtime.codes import DIVERGED, OK
from tests.model_exchange.model_exchange_client import DRIVEN_MODELS, handle_event_at, single_error

EVERY_MODEL = pytest.mark.parametrize("name", MODELS)


@EVERY_MODEL
def test_a_wild_trial_state_is_no_failure(launch_moving, name):
    fmu, t, states = launch_moving(name)
    fmu.set_point(t, states)
    before = fmu.rates(), fmu.indicators(), fmu.get(*outputs(name))
    for wild in (nan, inf, -inf, 1e308, -1e308, 1e200):
        for trial in ([wild] * 2, [states[0], wild], [wild, states[1]]):
            fmu.set_point(t, trial + states[2:])
            rates, _ = fmu.rates(), fmu.indicators()
            assert not isnan(wild) or any(isnan(rate) for rate in rates)
            fmu.get(*declarations_of(name))
    fmu.set_point(nan, states)
    fmu.rates()
    fmu.indicators()
    fmu.set_point(t, states)
    assert (fmu.rates(), fmu.indicators(), fmu.get(*outputs(name))) == before
    assert single_error(fmu) == ""
    fmu.enter_event_mode()
    assert fmu.update_discrete_states() == []


@EVERY_MODEL
@pytest.mark.parametrize(("size", "status"), [(1e90, OK), (1e110, DIVERGED), (1e300, DIVERGED), (nan, DIVERGED)])
def test_an_accepted_point_of_a_diverging_solution_ends_the_run(name, size, status):
    """Also where the outputs are finite."""
    exchange, calls = runtime(name, "model_exchange"), runtime(name, "call_sequence")
    model, run = model_exchange_run(model_class(name))
    exchange.enable(run)
    assert calls.exit_initialization(run, model) == OK
    exchange.begin(run, model)
    run.model_exchange.states[0] = size
    exchange.set_continuous_states(run, model)
    assert exchange.complete_step(run, model) == status


@EVERY_MODEL
def test_an_event_at_an_invalid_state_ends_the_run(launch_moving, name):
    """The importer stays at the invalid state; a saved state recovers."""
    fmu, t, states = launch_moving(name)
    fmu.set_point(t, states)
    expected = fmu.rates()
    state = fmu.save()
    for wild in (nan, inf, 1e300):
        with pytest.raises(FmiError, match="fmi3UpdateDiscreteStates returned status 3"):
            handle_event_at(fmu, t, [wild, wild, *states[2:]])
        assert "solution diverges" in single_error(fmu)
        fmu.restore(state)
        assert fmu.rates() == expected
    fmu.enter_event_mode()
    assert fmu.update_discrete_states() == []


def bad_settings(name):
    """Return values that are invalid once the run continues, and words of the message."""
    force, _ = push(name)
    x = outputs(name)[0]
    yield {force: nan}, f"{force} = nan"
    yield {"m": 0.0}, "m = 0.0"
    yield {f"{x}0": 0.5}, "fixed"
    if name in DRIVEN_MODELS:
        yield {"mu_d": 2.0}, "mu_d"


BAD = [(name, *bad) for name in MODELS for bad in bad_settings(name)]


@pytest.mark.parametrize("in_event", [True, False], ids=["event mode", "continuous time"])
@pytest.mark.parametrize(("name", "values", "words"), BAD, ids=[f"{name}-{next(iter(v))}" for name, v, _ in BAD])
def test_an_invalid_value_is_refused_and_changes_nothing(launch_moving, name, values, words, in_event):
    """A combination of valid values is refused where it is used; correcting one of them continues the run."""
    fmu, t, states = launch_moving(name)
    fmu.set_point(t, states)
    expected = fmu.rates(), fmu.get(*outputs(name))
    if in_event:
        fmu.enter_event_mode()
    ((variable, _),) = values.items()
    if variable == "mu_d":
        before = fmu.get(variable)
        fmu.set(values)
        with pytest.raises(FmiError):
            fmu.update_discrete_states() if in_event else fmu.rates()
        fmu.set({variable: before})
    else:
        with pytest.raises(FmiError, match="fmi3SetFloat64 returned status 3"):
            fmu.set(values)
    assert words in single_error(fmu)
    if in_event:
        fmu.update_discrete_states()
        fmu.enter_continuous_time()
    fmu.set_point(t, states)
    assert (fmu.rates(), fmu.get(*outputs(name))) == expected
    assert single_error(fmu) == ""


@EVERY_MODEL
def test_a_refused_start_value_leaves_the_default(launch, name):
    fmu = launch(name)
    expected = fmu.rates()
    fmu.reset()
    with pytest.raises(FmiError, match="fmi3SetFloat64 returned status 3"):
        fmu.set({"m": -1.0})
    assert "m = -1.0" in single_error(fmu)
    assert fmu.begin().update_discrete_states() == []
    assert fmu.rates() == expected
