"""Whole runs in one call: the same numbers as step by step, refusals, time limits, and FMUs that crash."""

import build_cache
import numpy as np
import pytest
from external_fmus import build_external_fmus
from native_fmus import build_native_fmus, require_compiler

from harness.api import simulate
from harness.running.native_equivalent import native_equivalent
from harness.running.whole_run import MAX_PREPARED, open_simulator
from harness.scenes.run_spec import RunSpec

T = np.linspace(0.0, 8.0, 401)


@pytest.fixture(scope="module", params=["python", "native", "fmi3"])
def sled(request, fmus):
    """The FMU stickslip of each kind."""
    if request.param == "python":
        return fmus / "stickslip.fmu"
    if request.param == "native":
        return build_native_fmus() / "stickslip.fmu"
    require_compiler()
    chosen = ("stickslip", "--fmi", "3", "--platform", "linux64")
    return build_cache.build_once("fmi3-stickslip", *chosen) / "stickslip.fmu"


def test_a_whole_run_is_the_run_step_by_step(sled, fmus):
    expected = simulate(fmus / "stickslip.fmu", {"mu_s": 0.8}, stop=8.0, interval=0.02, outputs=["x", "F_spring"])
    with open_simulator(RunSpec(sled)) as simulator:
        compiled = simulator.simulate({"mu_s": 0.8}, T, ["x", "F_spring"], {})
        assert simulator.simulate({"mu_s": -0.8}, T, ["x"], {}) is None  # refused
        simulator.runner.loop = None
        stepped = simulator.simulate({"mu_s": 0.8}, T, ["x", "F_spring"], {})
        assert simulator.simulate({"mu_s": -0.8}, T, ["x"], {}) is None
        assert simulator.n_runs == 4
    assert np.array_equal(compiled, stepped)
    for column, name in zip(compiled.T, ("x", "F_spring"), strict=True):
        assert np.abs(column - expected[name]).max() < 1e-12 * np.abs(column).max()


def test_inputs_are_means_over_steps_and_strides_skip_points(sled):
    force = 60.0 * np.sin(2.0 * T)
    with open_simulator(RunSpec(sled)) as simulator:
        every = simulator.simulate({}, T, ["x"], {"F_ext": force})
        second = simulator.simulate({}, T, ["x"], {"F_ext": force}, 2)
        constant = simulator.simulate({}, T, ["x"], {"F_ext": np.full(len(T), 20.0)})
        parameter = simulator.simulate({"F_ext": 20.0}, T, ["x"], {})
        simulator.runner.loop = None
        stepped = simulator.simulate({}, T, ["x"], {"F_ext": force})
    assert np.array_equal(every[::2], second)
    assert np.array_equal(every, stepped)
    assert np.abs(constant - parameter).max() < 1e-12


def test_runs_of_many_requests_do_not_mix(sled):
    """Of more requests than stay prepared, whose arrays live no longer than the run."""
    forces = [5.0 * i for i in range(MAX_PREPARED + 6)] * 2
    with open_simulator(RunSpec(sled)) as simulator:
        driven = [simulator.simulate({"k": 60.0}, T[:41].copy(), ["x"], {"F_ext": np.full(41, f)}) for f in forces]
        constant = [simulator.simulate({"k": 60.0, "F_ext": f}, T[:41], ["x"], {}) for f in forces]
        other = simulator.simulate({"k": 900.0, "F_ext": forces[-1]}, T[:41], ["x"], {})
    assert np.abs(np.array(driven) - constant).max() < 1e-12
    assert np.ptp([each[-1] for each in driven]) > 0
    assert not np.array_equal(other, constant[-1])


def test_settings_hold_in_every_run(sled):
    with open_simulator(RunSpec(sled, values={"friction": 3})) as simulator:
        first, second = (simulator.simulate({}, T, ["x"], {}) for _ in range(2))
    with open_simulator(RunSpec(sled)) as simulator:
        hybrid = simulator.simulate({}, T, ["x"], {})
    assert np.array_equal(first, second)
    assert not np.array_equal(first, hybrid)


def test_a_run_over_its_time_limit_is_refused(sled):
    with open_simulator(RunSpec(sled, timeout=1e-9)) as simulator:
        assert simulator.simulate({}, T, ["x"], {}) is None
        simulator.runner.loop = None
        assert simulator.simulate({}, T, ["x"], {}) is None


@pytest.mark.parametrize("name", ["Midpoint", "Fmi3FixedStep"])
def test_external_fmus_run_in_a_process_of_their_own(name):
    t = np.linspace(0.0, 1.0, 101)
    with open_simulator(RunSpec(build_external_fmus() / f"{name}.fmu")) as simulator:
        output = next(each for each, variable in simulator.variables.items() if variable.causality == "output")
        first, second = (simulator.simulate({"k": 0.9}, t, [output], {}) for _ in range(2))
    assert np.ptp(first) > 0
    assert np.array_equal(first, second)


def test_an_external_fmu_that_crashes_is_replaced():
    t = np.linspace(0.0, 1.0, 11)
    with open_simulator(RunSpec(build_external_fmus() / "Faulty.fmu")) as simulator:
        output = next(each for each, variable in simulator.variables.items() if variable.causality == "output")
        good = simulator.simulate({}, t, [output], {})
    with open_simulator(RunSpec(build_external_fmus() / "Faulty.fmu", values={"kind": 2})) as simulator:
        assert simulator.simulate({}, t, [output], {}) is None
        assert simulator.simulate({}, t, [output], {}) is None
    assert good is not None


def test_the_native_fmu_of_the_same_model_is_taken(fmus, tmp_path):
    """From the folder `native` beside the FMU."""
    (tmp_path / "native").mkdir()
    python, native = tmp_path / "sled.fmu", tmp_path / "native" / "sled.fmu"
    python.write_bytes((fmus / "stickslip.fmu").read_bytes())
    native.write_bytes((build_native_fmus() / "coulomb.fmu").read_bytes())
    assert native_equivalent(python) == python
    python.touch()
    native.write_bytes((build_native_fmus() / "stickslip.fmu").read_bytes())
    assert native_equivalent(python) == native
    assert native_equivalent(native) == native


def test_a_native_fmu_is_built_from_the_model_file(fmus, tmp_path):
    require_compiler()
    python = tmp_path / "smd.fmu"
    python.write_bytes((fmus / "smd.fmu").read_bytes())
    native = native_equivalent(python)
    assert native not in (python, fmus / "smd.fmu")
    with open_simulator(RunSpec(python)) as one, open_simulator(RunSpec(native)) as other:
        runs = [each.simulate({"m": 2.0}, T, ["x"], {}) for each in (one, other)]
    assert np.array_equal(*runs)
