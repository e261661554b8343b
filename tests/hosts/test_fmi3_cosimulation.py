"""FMI 3.0 co-simulation has the bits of FMI 2.0; the tests of what its interface does are repeated with its FMUs."""

import build_cache
import fmi3_fixtures
import numpy as np
import pytest
import worker_client
from models import MODELS, counts, declarations_of, each_case, model_class, outputs
from row_comparison import assert_identical

from harness.references.certified_reference import POINTS, load_reference, relative_errors
from tests.runtime.test_free_running import (  # noqa: F401
    test_a_later_start_time_only_shifts_the_motion,
    test_reading_changes_nothing_at_any_time,
    test_setting_a_value_to_itself_changes_nothing,
)
from tests.runtime.test_parameter_changes import (  # noqa: F401
    test_a_changed_value_acts_from_its_communication_point_on,
)
from tests.runtime.test_saved_state import (  # noqa: F401
    test_a_restored_state_continues_bit_for_bit,
    test_a_restored_state_recovers_from_a_failure_and_restores_a_pending_one,
    test_a_state_includes_parameters_not_yet_effective,
)

fmus = fmi3_fixtures.fmus
REACH = dict.fromkeys(MODELS, 1e-13) | {"pendulum": 1e-9, "pacejka": 1e-6}  # by default, relative


@pytest.mark.parametrize("name", MODELS)
def test_the_default_experiment_in_fmpy_reaches_the_reference(worker, fmus, name):
    truth = load_reference(name)
    interval = model_class(name).stop_time / (POINTS - 1)
    columns = worker.simulate(fmus / f"{name}.fmu", "CoSimulation", output_interval=interval)
    assert worker.read_stderr() == ""
    assert columns["time"] == truth.times.tolist()
    motion = np.array([columns[v] for v in outputs(name)[:2]]).T
    assert relative_errors(motion, truth.states).max() < REACH[name]
    if "mode" in columns:
        assert columns["mode"][-1] == truth.modes[-1][1]


@pytest.mark.parametrize("name", MODELS)
def test_time_and_indicators_are_readable_in_co_simulation(launch, name):
    """The event indicators of model exchange give the distance to the next event in co-simulation too."""
    fmu, stop, dry = launch(name), model_class(name).stop_time, "mode" in outputs(name)
    names = ["time", *(["mode", outputs(name)[1], "events.to_rest", "events.to_break_away"] if dry else [])]
    times = [stop * i / 200 for i in range(201)]
    for t, row in zip(times, fmu.run(times, names), strict=True):
        assert row[0] == t
        if dry:
            mode, v, to_rest, to_break_away = row[1:]
            assert to_rest == (mode * v + 1e-300 if mode else 1.0)  # never zero after event handling
            assert to_break_away > 0.0
            assert mode == 0 or to_break_away == 1.0


@pytest.fixture(scope="module")
def process():
    """A process that must exit cleanly."""
    worker = worker_client.Worker()
    yield worker
    assert worker.close() == 0


@each_case
def test_co_simulation_agrees_with_fmi2_bit_for_bit(process, fmus, case):
    """On the same grid, with a change of the input during the run and without a stop time."""
    name, values, stop = case
    names, times = outputs(name) + counts(name), [stop * i / 100 for i in range(101)]
    force = next(v for v, d in declarations_of(name).items() if d.causality == "input")
    changes = {times[30]: {force: 0.004 if name == "pendulum" else 3.0}, times[60]: {force: 0.0}}
    rows = []
    for folder in (fmus, build_cache.build_once()):
        fmu = process.instantiate(folder / f"{name}.fmu").begin(values)
        rows.append(fmu.run_with_changes(times, names, changes))
        fmu.free()
    assert_identical(*rows, names)
