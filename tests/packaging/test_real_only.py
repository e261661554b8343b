"""FMUs with Reals only, for hosts that read or set every variable as a Real.

The variables are chosen before any translation, so that two models are enough, with and without friction modes.
"""

from math import isnan

import build_cache
import fmi3_fixtures
import native_fmus
import pytest
from commands import build
from fmpy import read_model_description
from models import HYBRID, declarations_of, outputs
from variants import slow_after

from fmus.runtime.codes import NO_VALUE
from harness import SceneError, describe, simulate, sweep

OPTIONS = {
    "python": (),
    "native": ("--native", "--platform", "linux64"),
    "FMI 3.0": ("--fmi", "3", "--platform", "linux64"),
}
BUILDERS = {
    "python": build_cache.build_once,
    "native": native_fmus.build_native_fmus,
    "FMI 3.0": fmi3_fixtures.build_fmi3_fmus,
}
REAL = {"python": "Real", "native": "Real", "FMI 3.0": "Float64"}
REDUCED_MODELS = ("coulomb", "pacejka")
STEP, STEPS = 0.05, 40
BACKENDS = slow_after(2, ["python", "FMI 3.0", "native"])
FMI2 = pytest.mark.parametrize(
    "backend", slow_after(1, ["python", "native"]), indirect=True, scope="module"
)  # with internal steps


@pytest.fixture(scope="module", params=BACKENDS)
def backend(request):
    return request.param


@pytest.fixture(scope="module")
def folders(backend):
    """Return the folders with the FMUs that have all variables, and with those that have Reals only."""
    if backend != "python":
        native_fmus.require_compiler()
    return BUILDERS[backend](), build_cache.build_once(*REDUCED_MODELS, "--real-only", *OPTIONS[backend])


def motion(fmu, names):
    """Return the values of variables at each communication point."""
    fmu.begin()
    rows = [fmu.get(*names)]
    for i in range(STEPS):
        fmu.step(i * STEP, STEP)
        rows.append(fmu.get(*names))
    return rows


@pytest.mark.parametrize("name", REDUCED_MODELS)
def test_the_variables_are_reals_and_have_the_same_values(folders, backend, worker, name):
    complete_fmu, real_fmu = (folder / f"{name}.fmu" for folder in folders)
    description = read_model_description(real_fmu)
    assert {variable.type for variable in description.modelVariables} == {REAL[backend]}
    assert "--real-only" not in description.description
    assert "--real-only" in read_model_description(complete_fmu).description
    absent = {variable for variable, meaning in declarations_of(name).items() if meaning.items}
    present = {variable.name for variable in description.modelVariables}
    assert present == {variable.name for variable in read_model_description(complete_fmu).modelVariables} - absent
    names = [*outputs(name), "events.count", "solver.steps", "solver.evaluations"]
    assert motion(worker.instantiate(real_fmu), names) == motion(worker.instantiate(complete_fmu), names)


@FMI2
def test_results_state_the_method_and_the_law_that_the_build_fixed(folders):
    """Events are those of the FMU with all variables, which the harness finds by the law."""
    complete_run, real_run = (simulate(folder / "coulomb.fmu") for folder in folders)
    assert real_run.settings_label == complete_run.settings_label == "exact, hybrid"
    assert real_run.events is not None
    assert real_run.events.t.tolist() == complete_run.events.t.tolist()
    assert real_run.parameters.keys() == complete_run.parameters.keys()


@FMI2
def test_commands_work_with_the_choices_of_the_build(folders):
    fmu = folders[1] / "coulomb.fmu"
    description = describe(fmu)
    assert (description.laws, description.methods) == (("hybrid",), ("exact",))
    assert "Friction laws (friction): hybrid; fixed by the build" in str(description)
    assert simulate(fmu, {"friction": "hybrid"}, method="exact").settings_label == "exact, hybrid"
    with pytest.raises(SceneError, match=r"solver.method = 'ode23': coulomb.fmu was built with exact only; remove it"):
        simulate(fmu, method="ode23")
    assert "2 runs, 0 of them resumed, 0 failed" in str(sweep(fmu, {"f": [0.3, 0.4]}, workers=1))


def test_a_failed_run_leaves_no_mode_that_could_be_a_result(folders, backend, worker):
    complete_fmu, real_fmu = (worker.instantiate(folder / "coulomb.fmu") for folder in folders)
    for fmu in complete_fmu, real_fmu:
        fmu.begin({"m": 1e-300, "F_ext": 1e308})
        with pytest.raises(Exception, match="returned status"):
            fmu.step(0.0, STEP)
    assert complete_fmu.get("mode") == NO_VALUE
    assert all(isnan(value) for value in (*complete_fmu.get("x", "v"), *real_fmu.get("x", "mode", "solver.h")))
    worker.read_stderr()


def test_a_host_that_repeats_its_mistake_gets_one_message(fmus, worker):
    """Some hosts set enumerations as Reals at every step, and ignore that the step is refused."""
    fmu = worker.instantiate(fmus / "coulomb.fmu")
    fmu.begin()
    reference = [*declarations_of("coulomb")].index("friction")
    for i in range(20):
        fmu.write_one("Real", reference, HYBRID)
        with pytest.raises(Exception, match="returned status 2"):
            fmu.step(i * STEP, STEP)
        assert fmu.get("mode") == NO_VALUE
    assert len(fmu.messages()) == 1
    assert worker.read_stderr().count("\n") == 1


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (
            ("--method", "ode23", "--method", "exact"),
            "--method ode23 and exact: an FMU with Reals only has one: give --",
        ),
        (("--law", "hybrid", "--law", "sign"), "--law hybrid and sign: an FMU with Reals only has one: give --"),
        (("--law", "sign"), "the method 'exact' needs the law 'hybrid': give --law hybrid instead"),
        (("--web",), "--web writes a page, not FMUs: remove --native, --real-only"),
    ],
)
def test_options_that_contradict_are_refused(tmp_path, options, sentence):
    result = build("coulomb", "--real-only", *options, "--out", tmp_path)
    assert result.returncode in (1, 2)
    assert sentence in result.stderr
    assert not [*tmp_path.iterdir()]
