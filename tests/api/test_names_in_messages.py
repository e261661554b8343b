"""Messages name options of commands and arguments of the Python API that exist."""

import inspect
import re
from pathlib import Path

import commands
import external_fmus
import pytest

import harness

SOURCES = "\n".join(path.read_text() for path in Path(harness.__file__).parent.rglob("*.py"))
NAMES = sorted(set(re.findall(r"""option_text\(\s*["'](\w+)["']""", SOURCES)))
OPTIONS = {"inputs": "input", "values": "set", "folder": "out"}  # of commands, where the names differ
FUNCTIONS = [getattr(harness, name) for name in harness.__all__ if inspect.isfunction(getattr(harness, name))]


@pytest.fixture(scope="module")
def help_texts(tmp_path_factory):
    names = ("run", "sweep", "fit", "decay", "curve", "compare", "map")
    return "".join(commands.harness(tmp_path_factory.mktemp("help"), name, "--help").stdout for name in names)


@pytest.fixture(scope="module")
def external_fmu_folder():
    return external_fmus.build_external_fmus()


@pytest.mark.parametrize("name", NAMES)
def test_an_option_in_a_message_is_one_of_a_command_and_an_argument_of_the_api(name, help_texts):
    arguments = {argument for function in FUNCTIONS for argument in inspect.signature(function).parameters}
    assert name in arguments | set(inspect.signature(harness.DecayResult.save).parameters)
    assert re.search(rf"--{OPTIONS.get(name, name).replace('_', '-')}\b", help_texts)


def test_an_fmu_that_violates_the_standard_runs_in_python_as_the_message_says(external_fmu_folder):
    fmu = external_fmu_folder / "NonConforming.fmu"
    with pytest.raises(harness.HarnessError, match=r"to try to run it, use lenient=True") as error:
        harness.simulate(fmu)
    functions = re.findall(r"harness\.(\w+)", str(error.value))
    assert functions == ["simulate", "compare", "sweep"]
    assert all("lenient" in inspect.signature(getattr(harness, name)).parameters for name in functions)
    assert len(harness.simulate(fmu, lenient=True).time) > 1


def test_a_fit_of_an_fmu_with_clocks_names_the_functions_that_tick_them(external_fmu_folder):
    t = [0.1 * i for i in range(21)]
    with pytest.raises(harness.HarnessError, match="which only single runs, comparisons and sweeps tick"):
        harness.fit(external_fmu_folder / "Ticking.fmu", {"time": t, "x": t}, ["k"])
