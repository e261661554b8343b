"""The laws sign and threshold have no stick and slip; their modes change at events all the same."""

from itertools import pairwise
from pathlib import Path

import fmi3_fixtures
import fmpy
import pytest
from build_cache import build_user_model
from fmi3_as_fmi2 import Model, Slave
from models import EXAMPLE_MODELS, ODE23, RODAS, SIGN, THRESHOLD
from native_fmus import build_native_fmus

from harness.references.certified_reference import load_reference

# Model, law, and a stop time before the body rests, where the law chatters without end.
LAWS = [("coulomb", SIGN, 3.9), ("pendulum", SIGN, 4.4), ("stickslip", THRESHOLD, 4.803)]
EVERY_LAW = pytest.mark.parametrize(("name", "law", "stop"), LAWS)
RTOL = 1e-6  # no chattering before the body rests


def mode_changes(rows):
    """Return the times and modes of the rows (time, mode) in which the mode differs from that of the row before."""
    return [after for before, after in pairwise(rows) if after[1] != before[1]]


def follow(fmu, stop, *names):
    """Return rows of the named variables at communication points inside all internal steps and at their ends."""
    t, rows = 0.0, [(0.0, *fmu.get("mode", *names))]
    while t < stop:
        begin, end = t, min(fmu.get("solver.t_next"), stop)
        for share in (0.3, 0.7, 1.0):
            point = end if share == 1.0 else begin + share * (end - begin)
            fmu.step(t, point - t)
            t = point
            rows.append((t, *fmu.get("mode", *names)))
    return rows


@EVERY_LAW
@pytest.mark.parametrize("method", [ODE23, pytest.param(RODAS, marks=pytest.mark.slow)])
def test_every_change_of_mode_is_counted_with_its_time(worker, backend_fmus, name, law, stop, method):
    fmu = worker.instantiate(backend_fmus / f"{name}.fmu")
    fmu.begin({"friction": law, "solver.method": method, "solver.rtol": 1e-3}, stop=stop)
    rows, number, last = follow(fmu, stop, "events.count", "events.t_last"), 0, 0.0
    for (_, mode_before, _, _), (t, mode, count, t_last) in pairwise(rows):
        if mode != mode_before:
            number, last = number + 1, t
        assert (count, t_last) == (number, last)
    assert number > 1
    fmu.free()


@pytest.mark.slow
def test_the_events_of_the_threshold_law_are_those_of_the_certified_list(worker, backend_fmus):
    certified_changes = load_reference("stickslip-threshold").modes[1:]
    fmu = worker.instantiate(backend_fmus / "stickslip.fmu")
    fmu.begin({"friction": THRESHOLD, "solver.method": ODE23, "solver.rtol": RTOL}, stop=16.0)
    changes = mode_changes([row[:2] for row in follow(fmu, 16.0, "events.count")])
    assert [mode for _, mode in changes] == [mode for _, mode in certified_changes]
    assert [t for t, _ in changes] == pytest.approx([t for t, _ in certified_changes], abs=1e-3)
    assert fmu.get("events.count", "events.t_last") == [len(certified_changes), changes[-1][0]]
    fmu.free()


def test_a_model_with_conditions_counts_them_too(worker, tmp_path):
    """A condition lets the solver repeat steps, which must not count an event twice."""
    (path,) = (path for path in EXAMPLE_MODELS if path.stem == "rotor_brake")
    text = Path(path).read_text(encoding="utf-8").replace("Rule, State, exp", "Rule, State, choose, exp")
    text = text.replace("k * (turn - phi))", "k * choose(turn > phi, turn - phi, 2 * (turn - phi)))")
    (tmp_path / "rotor_brake.py").write_text(text, encoding="utf-8")
    fmu = worker.instantiate(build_user_model(tmp_path / "rotor_brake.py") / "rotor_brake.fmu")
    fmu.begin({"friction": THRESHOLD, "solver.rtol": RTOL, "omega_turn": 2.0, "c": 0.05, "omega0": -12.0}, stop=6.0)
    t, rows = 0.0, [(0.0, fmu.get("grip"))]
    while t < 6.0:
        end = min(fmu.get("solver.t_next"), 6.0)
        fmu.step(t, end - t)
        t = end
        rows.append((t, fmu.get("grip")))
    assert fmu.get("events.count") == len(mode_changes(rows)) > 1
    fmu.free()


@pytest.fixture(params=LAWS, ids=lambda pair: pair[0])
def fmi3_instance(request, tmp_path):
    """Return begin(class, **options), which makes an initialised FMI 3.0 instance with a law without sticking."""
    name, law, stop = request.param
    path = fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu"
    description, folder = fmpy.read_model_description(path), str(fmpy.extract(path, tmp_path))
    references, instances = {v.name: v.valueReference for v in description.modelVariables}, []

    def begin(kind, **options):
        fmu = kind(guid=description.guid, modelIdentifier=name, unzipDirectory=folder, instanceName=name)
        fmu.instantiate(**options)
        instances.append(fmu)
        fmu.setInteger([references["friction"], references["solver.method"]], [law, RODAS])
        fmu.setupExperiment(stopTime=stop)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        return fmu, references, description, stop

    yield begin
    for fmu in instances:
        fmu.freeInstance()


def test_in_co_simulation_with_event_mode_modes_change_there_only(fmi3_instance):
    fmu, references, _, stop = fmi3_instance(Slave, eventModeUsed=True, earlyReturnAllowed=True)
    counters = [references["mode"], references["events.count"]]
    fmu.updateDiscreteStates()
    fmu.enterStepMode()
    t, events = 0.0, 0
    while t < stop:
        before = fmu.getInteger(counters)
        needs_event, _, _, t = fmu.doStep(t, min(0.01, stop - t))
        assert fmu.getInteger(counters) == before
        if needs_event:
            fmu.enterEventMode()
            fmu.updateDiscreteStates()
            after = fmu.getInteger(counters)
            assert after[0] != before[0]
            assert after[1] == before[1] + 1
            events += 1
            fmu.enterStepMode()
    assert fmu.getInteger(counters)[1] == events > 1


def test_in_model_exchange_modes_change_at_step_events_only(fmi3_instance):
    fmu, references, description, _ = fmi3_instance(Model)
    assert description.modelExchange.needsCompletedIntegratorStep
    counters, states = [references["mode"], references["events.count"]], len(description.derivatives)
    fmu.updateDiscreteStates()
    fmu.enterContinuousTimeMode()
    start = [0.01, *[0.0] * (states - 1)]
    acceleration = [references["alpha" if "alpha" in references else "a"]]
    for number, (speed, mode) in enumerate([(0.0, 0), (0.2, 1), (0.3, 1), (-0.1, -1)]):
        before = fmu.getInteger(counters)
        fmu.setTime(0.1 * number)
        fmu.setContinuousStates((fmpy.fmi3.fmi3Float64 * states)(start[0], speed, *start[2:]), states)
        rate = fmu.getReal(acceleration)
        assert fmu.getInteger(counters) == before
        event, _ = fmu.completedIntegratorStep()
        assert event == (mode != before[0])
        if event:
            fmu.enterEventMode()
            assert fmu.updateDiscreteStates()[3] is False  # the states keep their values
            fmu.enterContinuousTimeMode()
        assert fmu.getInteger(counters) == [mode, before[1] + event]
        assert fmu.getReal(acceleration) == rate  # the force follows the speed without an event


def test_fmi2_asks_for_step_events_where_a_law_has_them():
    needs = {}
    for name in ("coulomb", "smd"):
        description = fmpy.read_model_description(build_native_fmus() / f"{name}.fmu")
        needs[name] = description.modelExchange.needsCompletedIntegratorStep
    assert needs == {"coulomb": True, "smd": False}


GRAZING = """from fmus import HYBRID, SIGN, Contact, Mode, Model, Output, Parameter, State, choose


class Grazing(Model):
    \"\"\"Block on a spring, and on a soft one beyond x = c.\"\"\"

    m = Parameter(1.0, "kg", "mass", above=0)
    k = Parameter(100.0, "N/m", "stiffness", low=0)
    f = Parameter(2.0, "N", "dry friction", low=0)
    c = Parameter(0.88, "m", "position of the soft spring", low=0)
    x = State("m", "position", start=-1.0)
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    F = Contact("N", "friction force", mode=mode, slip=v, slide=f, laws=(HYBRID, SIGN))
    a = Output("m/s2", "acceleration", (-k * x - F - choose(x > c, 1e-6 * k * (x - c), 0.0)) / m, rate_of=v)
"""


@pytest.mark.parametrize("method", [ODE23, RODAS])
def test_a_mode_counts_once_where_a_later_condition_is_in_doubt(worker, tmp_path, method):
    """The third turning point is near 0.88 m, where the motion is repeated with a tighter tolerance."""
    (tmp_path / "grazing.py").write_text(GRAZING)
    fmu = worker.instantiate(build_user_model(tmp_path / "grazing.py") / "grazing.fmu")
    fmu.begin({"friction": SIGN, "solver.method": method, "solver.rtol": 1e-3}, stop=1.6)
    fmu.step(0.0, 1.6)
    assert fmu.get("events.count") == 6  # the start and five turning points
    fmu.free()
