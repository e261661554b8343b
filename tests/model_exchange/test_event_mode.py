"""FMI 3.0 co-simulation with event mode, early return and intermediate update: the master sees stick and slip in
time."""

from contextlib import contextmanager
from math import inf

import fmi3_fixtures
import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from models import MODELS, declarations_of, model_class, outputs, push

from harness.references.certified_reference import load_reference

MODELS_WITH_MODES = [name for name in MODELS if "mode" in outputs(name)]
BREAKAWAY_TIME = 0.9 * 12.5 * 9.81 / (742.5 * 0.034)  # of the sled


@pytest.fixture(scope="module")
def unpack(tmp_path_factory):
    """Return unpack(name), which gives the folder of an FMU and its description."""
    temporary_folder, folders = tmp_path_factory.mktemp("unpacked"), {}

    def unpack(name):
        if name not in folders:
            path = fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu"
            folder = fmpy.extract(path, temporary_folder / name)
            folders[name] = str(folder), fmpy.read_model_description(path)
        return folders[name]

    return unpack


@contextmanager
def master(unpack, name, values=None, **options):
    """Return an initialised instance, and functions that read and write its variables by name."""
    folder, description = unpack(name)
    by_name = {variable.name: variable for variable in description.modelVariables}
    fmu = FMU3Slave(guid=description.instantiationToken, unzipDirectory=folder, modelIdentifier=name)
    fmu.instantiate(**options)

    def read(variable):
        get = fmu.getFloat64 if by_name[variable].type == "Float64" else fmu.getInt64
        return get([by_name[variable].valueReference])[0]

    def write(variable, value):
        (fmu.setFloat64 if by_name[variable].type == "Float64" else fmu.setInt64)(
            [by_name[variable].valueReference], [value]
        )

    for variable, value in (values or {}).items():
        write(variable, value)
    fmu.enterInitializationMode(startTime=0.0)
    fmu.exitInitializationMode()
    yield fmu, read, write
    fmu.terminate()
    fmu.freeInstance()


def handle(fmu):
    """Handle an event, from step mode back to step mode."""
    fmu.enterEventMode()
    needs_update, terminate, *_ = fmu.updateDiscreteStates()
    assert (needs_update, terminate) == (False, False)
    fmu.enterStepMode()


def through(fmu, stop, h, at_event):
    """Take steps of h and call `at_event(t, handled)` at every event; return the times of all returns."""
    t, times = 0.0, []
    while t < stop:
        ahead = min(h * (int(t / h + 1e-9) + 1), stop)
        event, terminate, early, t_end = fmu.doStep(t, ahead - t)
        assert not terminate
        assert early == (t_end < ahead)
        assert event or not early
        t = t_end
        times.append(t)
        if event:
            at_event(t)
    return times


@pytest.mark.parametrize("method", ["default", "ode45"])
@pytest.mark.parametrize("name", MODELS_WITH_MODES)
def test_a_master_with_long_steps_sees_every_event_at_its_time(unpack, name, method):
    """The old mode is valid until event mode is entered, and the new one from then on."""
    true, changes = load_reference(name).events, []
    stop = model_class(name).stop_time
    values = {} if method == "default" else {"solver.method": 3, "solver.rtol": 1e-10}
    with master(unpack, name, values, eventModeUsed=True, earlyReturnAllowed=True) as (fmu, read, _):
        fmu.updateDiscreteStates()
        fmu.enterStepMode()

        def at_event(t):
            before, n_before = read("mode"), read("events.count")
            handle(fmu)
            changes.append((t, read("mode")))
            assert read("mode") != before
            assert read("events.count") == n_before + 1 == len(changes)
            assert read("events.t_last") == t == read("time")

        through(fmu, stop, 1.0, at_event)
    assert [mode for _, mode in changes] == [mode for _, mode in true]
    off = max(abs(t - true_time) for (t, _), (true_time, _) in zip(changes, true, strict=True))
    assert off < (1e-12 if name == "stickslip" and method == "default" else 1e-6)


def test_the_sled_breaks_away_at_the_closed_form_time(unpack):
    with master(unpack, "stickslip", eventModeUsed=True, earlyReturnAllowed=True) as (fmu, read, _):
        fmu.updateDiscreteStates()
        fmu.enterStepMode()
        *_, early, t_end = fmu.doStep(0.0, 16.0)
        assert early
        assert t_end == pytest.approx(BREAKAWAY_TIME, abs=1e-14)
        assert read("mode") == 0
        assert read("F_friction") == pytest.approx(0.9 * 12.5 * 9.81, rel=1e-14)
        handle(fmu)
        assert read("F_friction") == pytest.approx(0.6 * 12.5 * 9.81, rel=1e-14)


def test_a_refused_end_of_initialisation_can_be_repeated(unpack, capfd):
    """Then the run begins in event mode, as without the refused call."""
    folder, description = unpack("stickslip")
    (sliding,) = (v.valueReference for v in description.modelVariables if v.name == "mu_d")
    fmu = FMU3Slave(guid=description.instantiationToken, unzipDirectory=folder, modelIdentifier="stickslip")
    fmu.instantiate(eventModeUsed=True, earlyReturnAllowed=True)
    fmu.enterInitializationMode(startTime=0.0)
    fmu.setFloat64([sliding], [1.0])  # more than mu_s
    with pytest.raises(FMICallException):
        fmu.exitInitializationMode()
    assert "mu_d" in capfd.readouterr().err
    with pytest.raises(FMICallException):
        fmu.updateDiscreteStates()
    assert "fmi3UpdateDiscreteStates" in capfd.readouterr().err
    fmu.setFloat64([sliding], [0.6])
    fmu.exitInitializationMode()
    fmu.updateDiscreteStates()
    fmu.enterStepMode()
    assert fmu.doStep(0.0, 16.0)[-1] == pytest.approx(BREAKAWAY_TIME, abs=1e-14)
    fmu.freeInstance()


@pytest.mark.parametrize("options", [{}, {"eventModeUsed": True}, {"earlyReturnAllowed": True}], ids=str)
@pytest.mark.parametrize("name", MODELS)
def test_the_motion_does_not_depend_on_the_steps_of_the_master(unpack, name, options):
    """To the last bit, whether events are handled inside a step, at its end, or after an early return."""
    stop, rows = model_class(name).stop_time, []
    for arguments in ({}, options):
        with master(unpack, name, **arguments) as (fmu, read, _):
            if arguments.get("eventModeUsed"):
                fmu.updateDiscreteStates()
                fmu.enterStepMode()
            t, row = 0.0, []
            for i in range(1, 33):
                while t < i * stop / 32:
                    event, _, early, t = fmu.doStep(t, i * stop / 32 - t)
                    assert event <= bool(arguments.get("eventModeUsed"))
                    assert early <= bool(arguments.get("earlyReturnAllowed"))
                    if event:
                        handle(fmu)
                row.append([read(variable) for variable in outputs(name)])
            rows.append(row)
    assert rows[0] == rows[1]


@pytest.mark.parametrize("early", [True, False])
@pytest.mark.parametrize("name", MODELS)
def test_discrete_variables_change_in_event_mode_only_and_every_event_is_announced(unpack, name, early):
    """Modes, counts and the time of the last event; where no early return is allowed, a step passes many events."""
    discrete = [v.name for v in unpack(name)[1].modelVariables if v.variability == "discrete"]
    stop, rows, n_announced = model_class(name).stop_time, [], 0

    def read_all():
        return [read(variable) for variable in discrete]

    def update(*_):
        rows.append(read_all())

    options = {"eventModeUsed": True, "earlyReturnAllowed": early, "intermediateUpdate": update}
    with master(unpack, name, **options) as (fmu, read, _):
        fmu.updateDiscreteStates()
        fmu.enterStepMode()
        t = 0.0
        while t < stop:
            before = read_all()
            rows.clear()
            event, _, _, t = fmu.doStep(t, min(t + 0.25 * stop, stop) - t)
            assert all(row == before for row in [*rows, read_all()])
            assert rows
            n_announced += event
            handle(fmu)
            if "mode" in discrete:
                assert event == (read("events.count") > before[discrete.index("events.count")])
            assert read("solver.steps") >= before[discrete.index("solver.steps")]
    assert (n_announced > 0) == (name in MODELS_WITH_MODES)


@pytest.mark.parametrize("name", MODELS_WITH_MODES)
def test_discrete_variables_do_not_change_in_intermediate_updates(unpack, name):
    """Without event mode they change at communication points."""
    rows, stop = [], model_class(name).stop_time

    def update(*_):
        rows.append([read("mode"), read("events.count"), read("solver.steps")])

    with master(unpack, name, intermediateUpdate=update) as (fmu, read, _):
        before = [read("mode"), read("events.count"), read("solver.steps")]
        fmu.doStep(0.0, stop)
        assert len(rows) > 2
        assert all(row == before for row in rows)
        assert read("events.count") > 0
        assert read("solver.steps") > 0


@pytest.mark.parametrize("early", [True, False])
@pytest.mark.parametrize("name", MODELS)
def test_intermediate_update_shows_every_internal_step_and_can_stop_anywhere(unpack, name, early):
    stop, rows, began, requested_time = 0.5 * model_class(name).stop_time, [], 0.0, 0.3 * model_class(name).stop_time
    reference = next(v.valueReference for v in unpack(name)[1].modelVariables if v.name == outputs(name)[0])

    def update(_, time, setting, getting, step_finished, may_return, request, when):
        rows.append((time, fmu.getFloat64([reference])[0]))
        assert (setting, getting, may_return) == (True, True, early)
        assert step_finished == (time > began)
        request[0], when[0] = True, requested_time

    with master(unpack, name, earlyReturnAllowed=early, intermediateUpdate=update) as (fmu, read, _):
        t = 0.0
        while t < requested_time:  # an event is an early return as well
            began = t
            _, _, early_return, t = fmu.doStep(t, stop - t)
            assert early_return == early
        assert t == (pytest.approx(requested_time, abs=1e-12) if early else stop)
        assert rows[-1] == (t, read(outputs(name)[0]))
        steps = read("solver.steps")
    with master(unpack, name) as (fmu, read, _):
        times = [time for time, _ in rows]
        assert times == sorted(times)
        for time, x in rows:
            t_inside = read("time")
            if time > t_inside:
                fmu.doStep(t_inside, time - t_inside)
            assert read(outputs(name)[0]) == pytest.approx(x, rel=1e-12, abs=1e-14)
    assert len(rows) > (0 if early else steps)


def test_a_value_set_at_an_event_acts_from_then_on(unpack):
    """A push at breakaway acts as if it were set between two steps at the same time."""
    rows = []
    for event_mode in (True, False):
        with master(unpack, "stickslip", eventModeUsed=event_mode, earlyReturnAllowed=True) as (fmu, read, write):
            if event_mode:
                fmu.updateDiscreteStates()
                fmu.enterStepMode()
            *_, t = fmu.doStep(0.0, 16.0)
            if event_mode:
                fmu.enterEventMode()
            write("F_ext", 50.0)
            if event_mode:
                fmu.updateDiscreteStates()
                fmu.enterStepMode()
            fmu.doStep(t, 0.1)
            rows.append([read(variable) for variable in (*outputs("stickslip"), "events.count", "events.t_last")])
    assert rows[0] == rows[1]
    assert rows[0][-2] == 1


@pytest.mark.parametrize("name", MODELS)
def test_an_input_set_during_intermediate_update_acts_from_then_on(unpack, name):
    """It acts as if it were set between two steps at the same time. Only inputs can be set there."""
    (force, size), stop = push(name), 0.5 * model_class(name).stop_time
    references = {v.name: v.valueReference for v in unpack(name)[1].modelVariables}
    rows, set_times = [], []

    def update(_, time, setting, getting, step_finished, may_return, request, when):
        if time > 0.3 * stop and not set_times:
            set_times.append(time)
            fmu.setFloat64([references[force]], [size])
            with pytest.raises(FMICallException):
                fmu.setFloat64([references["m"]], [1.0])

    for options in {"intermediateUpdate": update}, {}:
        with master(unpack, name, {"solver.method": 3}, **options) as (fmu, read, write):
            t = 0.0
            if set_times:
                (t,) = set_times
                fmu.doStep(0.0, t)
                write(force, size)
            fmu.doStep(t, stop - t)
            rows.append([read(variable) for variable in (*outputs(name), force)])
    assert rows[0] == rows[1]


@pytest.mark.parametrize("name", MODELS_WITH_MODES)
def test_a_pending_event_survives_save_and_restore(unpack, name):
    with master(unpack, name, eventModeUsed=True, earlyReturnAllowed=True) as (fmu, read, _):
        fmu.updateDiscreteStates()
        fmu.enterStepMode()
        *_, t = fmu.doStep(0.0, model_class(name).stop_time)
        state, rows = fmu.getFMUState(), []
        for _ in range(2):
            fmu.setFMUState(state)
            rows.append([read("mode"), read("events.count")])
            handle(fmu)
            fmu.doStep(t, 1e-3)
            rows[-1] += [read(variable) for variable in declarations_of(name) if variable != "solver.t_next"]
        fmu.freeFMUState(state)
    assert rows[0] == rows[1]
    assert inf not in rows[0]
