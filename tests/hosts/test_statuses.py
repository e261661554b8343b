"""Statuses of failures in a C host, by which tools such as fmusim end a run: by an error, or without one after Discard.

fmusim and the FMU Compliance Checker themselves are not available from package indices. test_refusals.py has the errors
of co-simulation.
"""

import os
from functools import partial
from math import nan
from zipfile import ZipFile

import native_fmus
import pytest
from native_host import begin, run_host_script, value_references

from benchmarks import c_host

OK, DISCARD, ERROR, FATAL = "0", "2", "3", "4"
TERMINATED = ["0 0x0p+0", "0 1"]  # after no step: last successful time, and whether the FMU terminates
STOP = 1.0
REFERENCES = value_references("stickslip")
EULER = "0 euler 3 0 0.5 5"  # position, speed, position of the driver; ends in event mode

pytestmark = pytest.mark.skipif(c_host.COMPILER is None, reason="there is no C compiler on this machine: install gcc")


def set_values(values):
    """Return the script that sets values."""
    return [f"0 setr {REFERENCES[name]} {value!r}" for name, value in values.items()]


def answers_of(fmu, script, **environment):
    """Return the answers without log messages, and the lines of standard error; a Python FMU gets its interpreter."""
    library = c_host.load_library(fmu)
    answers, stderr = run_host_script(fmu, script, environment=os.environ | dict(library.environment) | environment)
    return [answer for answer in answers if not answer.startswith("log ")], stderr.splitlines()


FAILURES = {
    "bad parameter": ({"m": -1.0}, {}),
    "contradicting start values": ({"mu_d": 1.0}, {}),
    "bad input": ({}, {"F_ext": nan}),
    "output set": ({}, {"x": 1.0}),
    "contradicting values": ({}, {"mu_s": 0.1}),
    "diverging run": ({}, {"F_ext": 1e308, "m": 1e-308}),
}


@pytest.mark.parametrize(("before", "during"), FAILURES.values(), ids=FAILURES)
def test_every_failure_of_fmi2_model_exchange_is_an_error(before, during):
    """Before the run or at an event; model_exchange/test_failures.py has those of FMI 3.0."""
    fmu = native_fmus.build_native_fmus() / "stickslip.fmu"
    script = ["0 new exchange", *set_values(before), *begin(0, stop=STOP)[1:], EULER, *set_values(during), "0 discrete"]
    answers, stderr = answers_of(fmu, script)
    first = next(answer for answer in answers if answer != OK)
    assert first == ERROR
    assert stderr[0].startswith("Stickslip (0): ")


@pytest.mark.parametrize("call", ["complete", "terminate"])
def test_a_solver_that_diverges_is_an_error_at_the_end_at_the_latest(call):
    """Trial points without finite results are no failure, so the FMU can refuse accepted ones only."""
    fmu = native_fmus.build_native_fmus() / "stickslip.fmu"
    start = ["0 new exchange", *set_values({"k": 1e60}), *begin(0, stop=STOP)[1:], "0 discrete", "0 continuous"]
    answers, (line,) = answers_of(fmu, [*start, "0 point 0.1 1e300 1.0 0.0", f"0 {call}"])
    assert answers == [OK] * (len(answers) - 1) + [ERROR]
    assert "the solution diverges" in line


@pytest.fixture
def python_run(fmus):
    """Return run(values, h): the answers and standard error of a step of a Python FMU after these values are set."""

    def run(fmu, values, h=0.1, **environment):
        script = [*begin(0, stop=STOP), *set_values(values), f"0 step 0 {h}", "0 status"]
        return answers_of(fmu, script, **environment)

    return partial(run, fmus / "stickslip.fmu")


def test_a_step_without_failure_returns_ok(python_run):
    answers, stderr = python_run({"F_ext": 5.0})
    assert answers == [OK] * (len(answers) - 2) + [f"0 {(0.1).hex()}", "0 0"]
    assert stderr == []


@pytest.mark.parametrize(
    ("values", "h"), [({"m": -1.0}, 0.1), ({"F_ext": nan}, 0.1), ({"F_ext": 1e308, "m": 1e-308}, 0.1), ({}, -0.1)]
)
def test_a_failure_of_a_python_fmu_looks_like_a_normal_end_as_its_page_states(fmus, python_run, values, h):
    answers, stderr = python_run(values, h)
    assert answers[-3:] == [DISCARD, *TERMINATED]
    assert len(stderr) == 1
    with ZipFile(fmus / "stickslip.fmu") as archive:
        page = " ".join(archive.read("documentation/index.html").decode().split())
    assert "returns Discard, because the native layer of PythonFMU cannot return Error" in page
    assert "use the native FMU in them" in page


def test_a_host_without_the_python_library_cannot_load_a_python_fmu(fmus, python_run):
    with pytest.raises(AssertionError, match="undefined symbol: "):
        python_run({}, LD_PRELOAD="")
    with ZipFile(fmus / "stickslip.fmu") as archive:
        assert "LD_PRELOAD" in archive.read("documentation/externalDependencies.txt").decode()


def test_the_layer_of_pythonfmu_turns_an_exception_into_fatal_and_never_into_an_error(fmus, tmp_path):
    """So a step that fails returns Discard; after Fatal a host may not even reset the instance."""
    with ZipFile(fmus / "stickslip.fmu") as source, ZipFile(tmp_path / "stickslip.fmu", "w") as target:
        for name in source.namelist():
            text = source.read(name)
            if name.endswith("/runtime/slave.py"):
                text += b"\n\ndef do_step(slave, t, h):\n    raise RuntimeError\n\n\nSlave.do_step = do_step\n"
            target.writestr(name, text)
    answers, _ = answers_of(tmp_path / "stickslip.fmu", [*begin(0, stop=STOP), "0 step 0 0.1"])
    assert answers[-1] == FATAL
