"""Model exchange call by call: states, rates and indicators, in every state, saved and restored, and after a reset."""

from math import isnan

import fmi3_by_hand
import pytest
from compare import identical
from fmi3_by_hand import DRIVEN, DRIVER, DRY, K, at_event, sentence
from models import CASES, MODELS, counts, declared, label, model_class, outputs, push

fmus, worker, _workers, launch, moving = fmi3_by_hand.FIXTURES
EVERY_MODEL = pytest.mark.parametrize("name", MODELS)


@EVERY_MODEL
def test_the_states_are_position_speed_and_the_driver(launch, name):
    fmu = launch(name)
    assert fmu.update() == []
    x, v = outputs(name)[:2]
    assert fmu.sizes() == [2 + (name in DRIVEN), 2 * (name in DRY)]
    assert fmu.where() == [declared(name)[f"{x}0"].start, declared(name)[f"{v}0"].start, *([0.0] * (name in DRIVEN))]
    assert fmu.nominals() == [1e-3] * fmu.sizes()[0]  # as solver.atol has it: in SI units


def test_where_creep_matters_the_nominal_speed_tells(launch):
    """An absolute tolerance of rtol times that must resolve the speed of the peak of the friction curve."""
    for x_m in (0.1, 0.01, 1e-4, 1e-6):
        fmu = launch("pacejka", {"x_m": x_m})
        x, v, driver = fmu.nominals()
        assert (x, driver) == (1e-3, 1e-3)
        assert v <= min(x_m, 1e-3)


@EVERY_MODEL
def test_start_values_become_the_states(launch, name):
    x, v = outputs(name)[:2]
    fmu = launch(name, {f"{x}0": 0.25, f"{v}0": -0.125})
    fmu.update()
    assert fmu.where()[:2] == [0.25, -0.125]
    if name in DRY:
        assert fmu.get("mode") == -1


@pytest.mark.parametrize("case", CASES, ids=label)
def test_it_begins_as_co_simulation_does(launch, worker, fmus, case):
    name, values, _ = case
    solver = worker.instantiate(fmus / f"{name}.fmu").begin(values)
    fmu = launch(name, values)
    assert fmu.update() == []
    fmu.go_on()
    assert fmu.get(*outputs(name)) == solver.get(*outputs(name))
    solver.free()


@EVERY_MODEL
def test_everything_may_be_asked_in_every_state(worker, fmus, name):
    """Some importers read all there is before initialisation has ended; nobody is told of a value before it is used."""
    fmu = worker.exchange(fmus / f"{name}.fmu")

    def ask():
        told = fmu.sizes(), fmu.where(), fmu.rates(), fmu.indicators(), fmu.nominals(), fmu.get(*outputs(name))
        assert sentence(fmu) == ""
        return told

    expected = ask()
    fmu.set({"m": -1.0})
    assert all(isnan(rate) for rate in ask()[2])
    fmu.set({"m": declared(name)["m"].start})
    fmu.setup(0.0, None, None)
    fmu.enter()
    assert ask() == expected
    fmu.exit()
    assert ask() == expected
    fmu.update()
    assert ask() == expected
    fmu.go_on()
    assert ask() == expected
    fmu.terminate()
    assert ask() == expected
    fmu.free()


@EVERY_MODEL
def test_rates_outputs_and_indicators_are_of_the_states_that_were_placed(moving, name):
    """In any order, bit for bit: nothing remembers where the solver has been."""
    fmu, t, states = moving(name)
    x, v, a = outputs(name)[:3]
    seen = {}
    for scale in (1.0, 0.7, 1.3, 0.7, 1.0):
        here = [scale * states[0], scale * states[1], *states[2:]]
        fmu.place(scale * t, here)
        rates, values = fmu.rates(), fmu.get("time", x, v, a)
        assert values[:3] == [scale * t, *here[:2]]
        assert values[3] == pytest.approx(rates[1], rel=1e-13)
        assert rates[0] == here[1]
        assert rates[2:] == [DRIVER] * (name in DRIVEN)
        assert fmu.where() == here
        if name in DRY:
            assert fmu.indicators() == [abs(here[1]), 1.0]
        told = rates, fmu.indicators(), fmu.get(*outputs(name))
        assert seen.setdefault(scale, told) == told
        if name in DRIVEN:
            assert fmu.get("x_driver") == here[2]
            assert fmu.get("F_spring") == pytest.approx(K * (here[2] - here[0]), rel=1e-14)


@EVERY_MODEL
def test_time_and_states_may_come_in_any_order(moving, name):
    fmu, t, states = moving(name)
    fmu.place(t, states)
    expected = fmu.rates(), fmu.indicators(), fmu.where(), fmu.get("time", *outputs(name))
    for calls in ([("put", states), ("at", t)], [("at", 2.0 * t), ("put", states), ("at", t)], [("put", states)] * 2):
        fmu.place(t, [0.5 * state for state in states])
        for call, argument in calls:
            getattr(fmu, call)(argument)
        assert (fmu.rates(), fmu.indicators(), fmu.where(), fmu.get("time", *outputs(name))) == expected


@EVERY_MODEL
def test_the_solver_of_the_fmu_has_no_part_in_it(moving, name):
    fmu, t, states = moving(name)
    fmu.place(t, states)
    fmu.rates()
    assert fmu.get("solver.steps", "solver.rejected", "solver.evaluations") == [0, 0, 0]
    assert fmu.get("solver.t_next") == t + model_class(name).stop_time  # no step of its own: a default run ahead


def test_the_variables_of_indicators_and_of_the_driver_read_as_they_do(moving):
    fmu, t, states = moving("stickslip")
    fmu.place(t, states)
    assert fmu.get("events.to_rest", "events.to_break_away") == fmu.indicators()
    assert fmu.get("der(x_driver)") == fmu.rates()[2]


# ---- saved states


@EVERY_MODEL
def test_a_restored_state_is_the_same_to_the_last_bit(moving, launch, name):
    """In this instance and, serialised, in another, in event mode and out of it."""
    fmu, t, states = moving(name)
    names = [*outputs(name), *counts(name), "time", "solver.t_next"]
    force, size = push(name)
    fmu.event()
    fmu.set({force: 0.01 * size})
    fmu.update()
    fmu.go_on()
    fmu.place(t, states)

    def all_of(instance):
        return [instance.where() + instance.rates() + instance.indicators() + instance.get(*names)]

    expected = all_of(fmu)
    labels = [str(i) for i in range(len(expected[0]))]
    state = fmu.save()
    for wild in ([0.0] * len(states), [-s for s in states]):
        at_event(fmu, t + 1.0, wild)
        fmu.set({force: 0.0, "m": 2.0})
        fmu.update()
        fmu.restore(state)
        identical(all_of(fmu), expected, labels)
    other = launch(name)
    other.restore(other.deserialize(fmu.serialize(state)))
    identical(all_of(other), expected, labels)
    identical([other.get(force, "m")], [fmu.get(force, "m")], [force, "m"])
    for instance in (fmu, other):
        instance.set({force: 3.0 * size})
    identical(all_of(other), all_of(fmu), labels)


@EVERY_MODEL
def test_three_hundred_resets_end_alike(moving, name):
    fmu, t, states = moving(name)
    begun = ["reset"], ["setup", 0.0, None, None], ["init"], ["update"], ["go_on"], ["place", t, states]
    calls = [[fmu.number, call, rest] for call, *rest in (*begun, ["rates"], ["indicators"], ["get", outputs(name)])]
    rows = {repr(fmu.worker.call(None, "several", calls)[len(begun) :]) for _ in range(300)}
    assert len(rows) == 1


@EVERY_MODEL
def test_reset_brings_every_start_value_back(launch, name):
    settable = {v: d.start for v, d in declared(name).items() if d.causality in ("parameter", "input")}
    fmu = launch(name, {push(name)[0]: 1.0, "m": 3.0})
    fmu.update()
    fmu.go_on()
    fmu.place(0.1, [0.2] * fmu.sizes()[0])
    fmu.reset()
    assert dict(zip(settable, fmu.get(*settable), strict=True)) == settable
