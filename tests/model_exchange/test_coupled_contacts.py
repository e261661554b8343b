"""Several contacts integrated by an importer's solver agree with the events of the equations."""

import fmpy
import numpy as np
import pytest
from build_cache import build_user_model
from contact_references import PROBLEMS, reference_events
from internal_steps import components, prepared_run, start
from models import DOP853, LARGER_MODELS
from native_fmus import require_compiler
from scipy.integrate import solve_ivp
from variants import campaign_after, slow_after

import harness
from fmus.compiler.lowering import lowered_model, model_exchange_run, sibling_module

FILES = {path.stem: path for path in LARGER_MODELS}


def integrate_with_indicators(name, stop):
    """Return time and modes of each event and the final state, from scipy with the indicators as event functions."""
    cls = lowered_model(FILES[name])
    exchange = sibling_module(cls, "runtime.model_exchange")
    model, run = model_exchange_run(cls)
    prepared_run(model, {"solver.method": DOP853, "solver.rtol": 1e-10}, run)
    start(model, run, model.initial_state(0.0), stop)
    solver = run.solver
    exchange.begin(run, model)

    def at(t, y):
        exchange.set_time(run, model, t)
        run.model_exchange.states[:] = map(float, y)
        exchange.set_continuous_states(run, model)

    def rates(t, y):
        at(t, y)
        exchange.update_rates(run, model)
        return list(run.model_exchange.rates)

    def states():
        exchange.update_states(run, model)
        return list(run.model_exchange.states)

    def indicator(i):
        def margin(t, y):
            at(t, y)
            exchange.update_indicators(run, model)
            return run.model_exchange.indicators[i]

        margin.terminal, margin.direction = True, -1
        return margin

    t, y, events = 0.0, states(), []
    indicators = [indicator(i) for i in range(2 * len(model.contacts))]
    while True:
        solution = solve_ivp(rates, (t, stop), y, "DOP853", events=indicators, rtol=1e-11, atol=1e-14, max_step=0.05)
        t, y = solution.t[-1], solution.y[:, -1]
        if solution.status != 1:
            return events, y
        assert len(events) < 99
        beyond = 1e-12 * (1.0 + t)  # an importer's solver stops just beyond the root
        t, y = t + beyond, y + beyond * np.array(rates(t, y))
        at(t, y)
        before = components(solver, "modes", model.contacts)
        exchange.update_modes(run, model)
        assert not exchange.update_modes(run, model)
        y = states()
        modes = components(solver, "modes", model.contacts)
        if modes != before:
            events.append((t, *modes))


@pytest.mark.parametrize("name", slow_after(3, [name for name in PROBLEMS if name != "clutch"]))  # which lifts off
def test_modes_follow_at_the_events_located_by_an_importer(name):
    """A second update changes nothing."""
    true, end = reference_events(name)
    events, final = integrate_with_indicators(name, PROBLEMS[name].stop)
    assert [modes for _, *modes in events] == [modes for _, *modes in true]
    assert np.abs(np.array([t for t, *_ in events]) - [t for t, *_ in true]).max() < 1e-7
    assert np.abs(np.array(final)[: len(end)] - end).max() < 1e-6


@pytest.mark.parametrize(("name", "push"), campaign_after(1, [("sleds", 12.0), ("sleds", 0.0), ("stacked", 0.0)]))
def test_coupled_bodies_stick_under_fixed_steps(name, push):
    """A slip is far beyond zero when a fixed step notices it; the events are those of co-simulation all the same."""
    require_compiler()
    fmu = build_user_model(FILES[name], "--native", "--platform", "linux64") / "native" / f"{name}.fmu"
    time, h, stop = np.linspace(0.0, 10.0, 101), 1e-3, 10.0
    signal = np.array([*zip(time, push * np.sin(1.3 * time), strict=True)], dtype=[("time", float), ("F_ext", float)])
    truth = harness.simulate(fmu, inputs={name: signal[name] for name in signal.dtype.names}, times=[stop], stop=stop)
    options = {"solver": "Euler", "step_size": h, "output_interval": h, "input": signal, "stop_time": stop}
    names = "x_1", "x_2"
    end = fmpy.simulate_fmu(fmu, fmi_type="ModelExchange", output=[*names, "events.count"], **options)[-1]
    assert end["events.count"] == truth.statistics.events
    for name in names:
        assert end[name] == pytest.approx(truth[name][-1], rel=1e-2, abs=5.0 * h)
