"""Whole runs in one call: the same numbers as step by step, refusals, time limits, and FMUs that crash."""

from dataclasses import replace

import commands
import numpy as np
import pytest
from external_fmus import build_external_fmus
from fmi3_fixtures import build_fmi3_fmus
from fmpy import read_model_description
from native_fmus import build_native_fmus, require_compiler
from scipy.integrate import solve_ivp
from spec_runs import run_spec

from harness.scenes.run_spec import RunSpec
from harness.simulation.native_equivalent import native_equivalent
from harness.simulation.whole_run import open_simulator

T = np.linspace(0.0, 8.0, 401)


@pytest.fixture(scope="module", params=["python", "native", "fmi3"])
def sled(request, fmus):
    """The FMU stickslip of each kind."""
    if request.param == "python":
        return fmus / "stickslip.fmu"
    if request.param == "native":
        return build_native_fmus() / "stickslip.fmu"
    return build_fmi3_fmus() / "stickslip.fmu"


@pytest.fixture
def simulator(sled):
    """Runs of the FMU with the output x, at 401 times."""
    with open_simulator(RunSpec(sled, ("x",), times=T, follow=False)) as opened_simulator:
        yield opened_simulator


def run_each_way(simulator, spec, values):
    """Return the outputs of a run by the compiled loop; the loop in Python must return the same.

    In a child process, both are the compiled loop.
    """
    compiled_outputs = simulator.prepare(spec)(values)
    loop = getattr(simulator, "loop", None)
    simulator.loop = None
    python_outputs = simulator.prepare(spec)(values)
    simulator.loop = loop
    assert (compiled_outputs is None and python_outputs is None) or np.array_equal(compiled_outputs, python_outputs)
    return compiled_outputs


UNEVEN = np.sort(np.random.default_rng(1).uniform(0.5, 7.5, 60))
FORCE = {"time": np.linspace(-1.0, 9.0, 201), "F_ext": 60.0 * np.sin(2.0 * np.linspace(-1.0, 9.0, 201))}
JUMPS = {"time": (1.0, 2.0, 2.0, 5.0, 5.0), "F_ext": (0.0, 30.0, 10.0, 40.0, -40.0)}
RUNS = {
    "even times": {"times": T},
    "times apart from start and stop": {"times": UNEVEN, "stop": 8.0},
    "times a rounding from start and stop": {"times": [1e-13, *UNEVEN, 8.0 - 1e-13], "stop": 8.0},
    "a grid": {"grid": 0.03, "stop": 8.0},
    "equal steps": {"equal_steps": 100, "stop": 8.0},
    "times and a grid": {"grid": 0.03, "times": UNEVEN, "stop": 8.0},
    "inputs": {"inputs": FORCE, "times": T},
    "inputs at other times": {"inputs": FORCE, "times": UNEVEN, "stop": 8.0},
    "inputs that jump": {"inputs": JUMPS, "times": UNEVEN, "stop": 8.0},
}


@pytest.mark.parametrize("options", RUNS.values(), ids=RUNS)
def test_a_whole_run_is_that_of_simulate(sled, fmus, options):
    if "inputs" in options and interpolates_inputs(sled):
        pytest.skip("its inputs are linear in each step, and constant in the steps of `simulate`")
    spec = RunSpec(sled, ("x", "F_spring"), follow=False, **options)
    expected = run_spec(replace(spec, fmu=fmus / "stickslip.fmu", values={"mu_s": 0.8}))
    with open_simulator(spec) as simulator:
        y = run_each_way(simulator, spec, {"mu_s": 0.8})
        assert run_each_way(simulator, spec, {"mu_s": -0.8}) is None  # refused
        assert simulator.n_runs == 4
    for column, name in zip(y.T, spec.outputs, strict=True):
        assert np.ptp(column) > 0.0
        assert np.abs(column - expected[name]).max() < 1e-12 * np.abs(column).max()


def interpolates_inputs(fmu):
    return read_model_description(fmu).coSimulation.canInterpolateInputs


def test_an_input_is_linear_in_a_step_if_the_fmu_interpolates_inputs():
    """Also where it jumps; scipy solves the same problem piece by piece."""
    t = np.linspace(0.0, 4.0, 21)
    inputs = {"time": (0.0, 1.0, 1.0, 3.0, 4.0), "F_ext": (1.0, -4.0, 6.0, -2.0, 9.0)}
    spec = RunSpec(build_native_fmus() / "smd.fmu", ("x",), inputs=inputs, times=t, follow=False)
    with open_simulator(spec) as simulator:
        x = run_each_way(simulator, spec, {"m": 1.0, "k": 50.0, "c": 0.5, "x0": 0.1})[:, 0]
    state, expected = [0.1, 0.0], []
    for begin, end, low, high in ((0.0, 1.0, 1.0, -4.0), (1.0, 3.0, 6.0, -2.0), (3.0, 4.0, -2.0, 9.0)):

        def rates(t, y, begin=begin, end=end, low=low, high=high):
            return [y[1], low + (high - low) * (t - begin) / (end - begin) - 50.0 * y[0] - 0.5 * y[1]]

        piece = solve_ivp(rates, (begin, end), state, t_eval=t[(t >= begin) & (t <= end)], rtol=1e-11, atol=1e-13)
        state = piece.y[:, -1]
        expected += piece.y[0, bool(expected) :].tolist()
    assert np.abs(x - expected).max() < 1e-9


def test_other_inputs_are_their_mean_over_a_step(simulator, sled):
    if interpolates_inputs(sled):
        pytest.skip("its inputs are linear in each step")
    force = 60.0 * np.sin(2.0 * T)
    driven_outputs = simulator.prepare(replace(simulator.spec, inputs={"time": T, "F_ext": force}))({})
    times, means = np.repeat(T, 2)[1:-1], np.repeat(0.5 * (force[1:] + force[:-1]), 2)
    constant = simulator.prepare(replace(simulator.spec, inputs={"time": times, "F_ext": means}))({})
    assert np.abs(driven_outputs - constant).max() < 1e-12 * np.abs(driven_outputs).max()


def test_prepared_runs_do_not_mix(simulator):
    """Of one FMU, in turn, and with values of other variables."""
    forces = [40.0 * i for i in range(8)]
    inputs = [{"time": (0.0, 8.0), "F_ext": (force, force)} for force in forces]
    runs = [simulator.prepare(replace(simulator.spec, inputs=table)) for table in inputs]
    other = simulator.prepare(simulator.spec)
    for _ in range(2):
        driven_outputs = [run({"k": 60.0}) for run in runs]
        constant = [other({"k": 60.0, "F_ext": force}) for force in forces]
        assert np.abs(np.array(driven_outputs) - constant).max() < 1e-12
        assert np.ptp([x[-1] for x in driven_outputs]) > 0
        assert not np.array_equal(other({"k": 900.0, "F_ext": forces[-1]}), constant[-1])
        assert not np.array_equal(other({"F_ext": forces[-1]}), constant[-1])


def test_values_of_the_specification_hold_in_every_run(simulator):
    threshold = simulator.prepare(replace(simulator.spec, values={"friction": 3}))
    first, second = threshold({}), threshold({})
    assert np.array_equal(first, second)
    assert not np.array_equal(first, simulator.prepare(simulator.spec)({}))


def test_a_run_over_its_time_limit_is_refused(sled):
    spec = RunSpec(sled, ("x",), times=T, follow=False, timeout=1e-9)
    with open_simulator(spec) as simulator:
        assert run_each_way(simulator, spec, {}) is None


@pytest.mark.parametrize("name", ["Midpoint", "Fmi3FixedStep"])
def test_external_fmus_run_in_a_process_of_their_own(name):
    spec = RunSpec(build_external_fmus() / f"{name}.fmu", ("x",), times=np.linspace(0.0, 1.0, 101), follow=False)
    with open_simulator(spec) as simulator:
        run, other = simulator.prepare(spec), simulator.prepare(replace(spec, times=spec.times[::2], stop=1.0))
        first, coarse, second = run({"k": 0.9}), other({"k": 0.9}), run({"k": 0.9})
    assert np.ptp(first) > 0
    assert np.array_equal(first, second)
    assert coarse.shape == (51, 1)


@pytest.mark.parametrize(("name", "value"), [("Faulty", {"kind": 5}), ("Fmi3Midpoint", {"limit": 0.5})])
def test_a_run_that_is_lost_or_terminates_is_refused(name, value):
    spec = RunSpec(build_external_fmus() / f"{name}.fmu", ("x",), times=np.linspace(0.0, 1.0, 11), follow=False)
    with open_simulator(spec) as simulator:
        assert simulator.prepare(spec)({}) is not None
        assert simulator.prepare(replace(spec, values=value))({}) is None


PYTHON_LOOP = """
import sys
from dataclasses import replace
from pathlib import Path
import numpy as np
from harness.simulation.whole_run import Simulator
from harness.scenes.run_spec import RunSpec

simulator = Simulator(RunSpec(Path(sys.argv[1])))
simulator.loop = None
spec = RunSpec(Path("Faulty.fmu"), ("x",), times=np.linspace(0.0, 1.0, 11), follow=False)
print(simulator.prepare(spec)({}) is None, simulator.prepare(replace(spec, values={"kind": 5}))({}) is None)
simulator.close()
"""


def test_the_loop_in_python_refuses_outputs_that_are_not_finite(tmp_path):
    """A process of its own loads the FMU, whose pythonfmu would replace the installed one for later tests."""
    result = commands.run_python(tmp_path, "-c", PYTHON_LOOP, build_external_fmus() / "Faulty.fmu")
    assert (result.stdout, result.stderr) == ("False True\n", "")


def test_an_external_fmu_that_crashes_is_replaced():
    spec = RunSpec(build_external_fmus() / "Faulty.fmu", ("x",), times=np.linspace(0.0, 1.0, 11), follow=False)
    with open_simulator(spec) as simulator:
        good = simulator.prepare(spec)
        crashing = simulator.prepare(replace(spec, values={"kind": 2}))
        before = good({})
        assert crashing({}) is None
        assert crashing({}) is None
        assert np.array_equal(good({}), before)
    assert before is not None


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


@pytest.mark.campaign
def test_a_native_fmu_is_built_from_the_model_file(fmus, tmp_path):
    require_compiler()
    python = tmp_path / "smd.fmu"
    python.write_bytes((fmus / "smd.fmu").read_bytes())
    native = native_equivalent(python)
    assert native not in (python, fmus / "smd.fmu")
    run = RunSpec(python, ("x",), times=T, follow=False)
    with open_simulator(run) as python_simulator, open_simulator(replace(run, fmu=native)) as native_simulator:
        runs = [simulator.prepare(simulator.spec)({"m": 2.0}) for simulator in (python_simulator, native_simulator)]
    assert np.array_equal(*runs)
