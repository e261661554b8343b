"""Model exchange call by call: states, rates and indicators in every phase, after restoring a state, and after a
reset."""

import pytest
from models import MODELS, counts, declarations_of, each_case, model_class, outputs, push
from row_comparison import assert_identical
from worker_client import FmiError

from tests.model_exchange.model_exchange_client import DRIVEN_MODELS, DRIVER, DRY, K, handle_event_at, single_error

EVERY_MODEL = pytest.mark.parametrize("name", MODELS)


@EVERY_MODEL
def test_the_states_are_position_speed_and_the_driver(launch, name):
    fmu = launch(name)
    assert fmu.update_discrete_states() == []
    x, v = outputs(name)[:2]
    assert fmu.sizes() == [2 + (name in DRIVEN_MODELS), 2 * (name in DRY)]
    assert fmu.get_states() == [
        declarations_of(name)[f"{x}0"].start,
        declarations_of(name)[f"{v}0"].start,
        *([0.0] * (name in DRIVEN_MODELS)),
    ]
    assert fmu.nominals() == [1e-3] * fmu.sizes()[0]  # as solver.atol, in SI units


def test_the_nominal_speed_is_small_where_creep_matters(launch):
    """rtol times the nominal speed as absolute tolerance must resolve the speed at the peak of the friction curve."""
    for x_m in (0.1, 0.01, 1e-4, 1e-6):
        fmu = launch("pacejka", {"x_m": x_m})
        x, v, driver = fmu.nominals()
        assert (x, driver) == (1e-3, 1e-3)
        assert v <= min(x_m, 1e-3)


@EVERY_MODEL
def test_start_values_become_the_states(launch, name):
    x, v = outputs(name)[:2]
    fmu = launch(name, {f"{x}0": 0.25, f"{v}0": -0.125})
    fmu.update_discrete_states()
    assert fmu.get_states()[:2] == [0.25, -0.125]
    if name in DRY:
        assert fmu.get("mode") == -1


@each_case
def test_model_exchange_starts_like_co_simulation(launch, worker, fmus, case):
    name, values, _ = case
    solver = worker.instantiate(fmus / f"{name}.fmu").begin(values)
    fmu = launch(name, values)
    assert fmu.update_discrete_states() == []
    fmu.enter_continuous_time()
    assert fmu.get(*outputs(name)) == solver.get(*outputs(name))
    solver.free()


@EVERY_MODEL
def test_every_variable_can_be_read_in_every_phase(worker, fmus, name):
    """Some importers read all variables during initialisation; no value is reported before it is valid."""
    fmu = worker.exchange(fmus / f"{name}.fmu")

    def ask():
        values = fmu.sizes(), fmu.get_states(), fmu.rates(), fmu.indicators(), fmu.nominals(), fmu.get(*outputs(name))
        assert single_error(fmu) == ""
        return values

    expected = ask()
    with pytest.raises(FmiError):
        fmu.set({"m": -1.0})
    single_error(fmu)
    assert ask() == expected
    fmu.setup(0.0, None, None)
    fmu.enter()
    assert ask() == expected
    fmu.exit()
    assert ask() == expected
    fmu.update_discrete_states()
    assert ask() == expected
    fmu.enter_continuous_time()
    assert ask() == expected
    fmu.terminate()
    assert ask() == expected
    fmu.free()


@EVERY_MODEL
def test_rates_outputs_and_indicators_depend_only_on_the_set_states(launch_moving, name):
    """In any order, bit for bit: the FMU does not remember earlier solver states."""
    fmu, t, states = launch_moving(name)
    x, v, a = outputs(name)[:3]
    results = {}
    for scale in (1.0, 0.7, 1.3, 0.7, 1.0):
        point = [scale * states[0], scale * states[1], *states[2:]]
        fmu.set_point(scale * t, point)
        rates, values = fmu.rates(), fmu.get("time", x, v, a)
        assert values[:3] == [scale * t, *point[:2]]
        assert values[3] == pytest.approx(rates[1], rel=1e-13)
        assert rates[0] == point[1]
        assert rates[2:] == [DRIVER] * (name in DRIVEN_MODELS)
        assert fmu.get_states() == point
        if name in DRY:
            assert fmu.indicators() == [abs(point[1]), 1.0]
        result = rates, fmu.indicators(), fmu.get(*outputs(name))
        assert results.setdefault(scale, result) == result
        if name in DRIVEN_MODELS:
            assert fmu.get("x_driver") == point[2]
            assert fmu.get("F_spring") == pytest.approx(K * (point[2] - point[0]), rel=1e-14)


@EVERY_MODEL
def test_time_and_states_may_be_set_in_any_order(launch_moving, name):
    fmu, t, states = launch_moving(name)
    fmu.set_point(t, states)
    expected = fmu.rates(), fmu.indicators(), fmu.get_states(), fmu.get("time", *outputs(name))
    for calls in (
        [("set_states", states), ("set_time", t)],
        [("set_time", 2.0 * t), ("set_states", states), ("set_time", t)],
        [("set_states", states)] * 2,
    ):
        fmu.set_point(t, [0.5 * state for state in states])
        for call, argument in calls:
            getattr(fmu, call)(argument)
        assert (fmu.rates(), fmu.indicators(), fmu.get_states(), fmu.get("time", *outputs(name))) == expected


@EVERY_MODEL
def test_the_solver_of_the_fmu_is_not_involved(launch_moving, name):
    fmu, t, states = launch_moving(name)
    fmu.set_point(t, states)
    fmu.rates()
    assert fmu.get("solver.steps", "solver.rejected", "solver.evaluations") == [0, 0, 0]
    assert fmu.get("solver.t_next") == t + model_class(name).stop_time  # no step of its own: the end of a default run


def test_indicator_and_driver_variables_agree_with_their_functions(launch_moving):
    fmu, t, states = launch_moving("stickslip")
    fmu.set_point(t, states)
    assert fmu.get("events.to_rest", "events.to_break_away") == fmu.indicators()
    assert fmu.get("der(x_driver)") == fmu.rates()[2]


# ---- saved states


@EVERY_MODEL
def test_a_restored_state_is_bitwise_identical(launch_moving, launch, name):
    """In this instance and, serialised, in another; in event mode and outside of it."""
    fmu, t, states = launch_moving(name)
    names = [*outputs(name), *counts(name), "time", "solver.t_next"]
    force, size = push(name)
    fmu.enter_event_mode()
    fmu.set({force: 0.01 * size})
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    fmu.set_point(t, states)

    def all_of(instance):
        return [instance.get_states() + instance.rates() + instance.indicators() + instance.get(*names)]

    expected = all_of(fmu)
    labels = [str(i) for i in range(len(expected[0]))]
    state = fmu.save()
    for wild in ([0.0] * len(states), [-s for s in states]):
        handle_event_at(fmu, t + 1.0, wild)
        fmu.set({force: 0.0, "m": 2.0})
        fmu.update_discrete_states()
        fmu.restore(state)
        assert_identical(all_of(fmu), expected, labels)
    other = launch(name)
    other.restore(other.deserialize(fmu.serialize(state)))
    assert_identical(all_of(other), expected, labels)
    assert_identical([other.get(force, "m")], [fmu.get(force, "m")], [force, "m"])
    for instance in (fmu, other):
        instance.set({force: 3.0 * size})
    assert_identical(all_of(other), all_of(fmu), labels)


@EVERY_MODEL
def test_three_hundred_resets_end_alike(launch_moving, name):
    fmu, t, states = launch_moving(name)
    running = (
        ["reset"],
        ["setup", 0.0, None, None],
        ["init"],
        ["update_discrete_states"],
        ["enter_continuous_time"],
        ["set_point", t, states],
    )
    calls = [[fmu.number, call, rest] for call, *rest in (*running, ["rates"], ["indicators"], ["get", outputs(name)])]
    rows = {repr(fmu.worker.call(None, "batch", calls)[len(running) :]) for _ in range(300)}
    assert len(rows) == 1


@EVERY_MODEL
def test_reset_restores_every_start_value(launch, name):
    settable = {v: d.start for v, d in declarations_of(name).items() if d.causality in ("parameter", "input")}
    fmu = launch(name, {push(name)[0]: 1.0, "m": 3.0})
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    fmu.set_point(0.1, [0.2] * fmu.sizes()[0])
    fmu.reset()
    assert dict(zip(settable, fmu.get(*settable), strict=True)) == settable
