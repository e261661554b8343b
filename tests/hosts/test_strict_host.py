"""Exit status of a C host that ends runs like fmusim: by an error, or without one if a step returns Discard.

fmusim and the FMU Compliance Checker themselves are not available from package indices.
"""

import subprocess
from math import inf, nan
from pathlib import Path
from zipfile import ZipFile

import native_fmus
import pytest

from harness.running import c_host

HOST = Path(__file__).parents[1] / "support" / "strict_host.c"
STOP = 1.0
STATES = 3  # of the sled in model exchange: position, speed, position of the driver

pytestmark = pytest.mark.skipif(c_host.COMPILER is None, reason="there is no C compiler on this machine: install gcc")

FAILURES = {
    "bad parameter": ({"m": -1.0}, {}, ()),
    "bad start value": ({"x0": nan}, {}, ()),
    "output set before the run": ({"x": 1.0}, {}, ()),
    "contradicting values": ({"mu_d": 1.0}, {}, ()),
    "bad input": ({}, {"F_ext": nan}, ()),
    "output set": ({}, {"x": 1.0}, ()),
    "start value set": ({}, {"x0": 0.5}, ()),
    "values that contradict each other": ({}, {"mu_s": 0.1}, ()),
    "unknown reference": ({}, {"?": 1.0}, ()),
    "diverging run": ({}, {"F_ext": 1e308, "m": 1e-308}, ()),
    "step from the past": ({}, {}, (0.0, 0.1)),
    "step of no size": ({}, {}, (0.5, 0.0)),
    "step backwards": ({}, {}, (0.5, -0.1)),
    "step without end": ({}, {}, (0.5, inf)),
    "step beyond the stop": ({}, {}, (0.5, 9.0)),
}


def run(fmu, values=None, changes=None, step=(), exchange=(), **environment):
    """Run the sled in the host, or let the host integrate it; return the process."""
    library = c_host.load_library(fmu)
    references = library.references | {"?": 10**6}

    def words(settings):
        return [f"{references[name]}={value!r}" for name, value in settings.items()]

    program = c_host.compile_source(HOST, "strict_host", (), ("-ldl",))
    command = [program, library.file, library.guid, library.resources, STOP, *exchange, *words(values or {})]
    command += ["during", *words(changes)] if changes else []
    command += ["step", *map(repr, step)] if step else []
    return subprocess.run(
        [str(word) for word in command],
        capture_output=True,
        text=True,
        env=dict(library.environment) | environment,
        timeout=60,
    )


@pytest.mark.parametrize("failure", FAILURES.values(), ids=FAILURES)
def test_every_failure_of_a_native_fmu_is_an_error(failure):
    process = run(native_fmus.build_native_fmus() / "stickslip.fmu", *failure)
    assert process.returncode == 1, process.stdout
    assert process.stdout.endswith(" 3\n")
    assert len(process.stderr.splitlines()) == 1


@pytest.mark.parametrize("steps", ["euler", "completing"])
@pytest.mark.parametrize("failure", [key for key, (_, _, step) in FAILURES.items() if not step])
def test_every_failure_in_model_exchange_is_an_error(failure, steps):
    process = run(native_fmus.build_native_fmus() / "stickslip.fmu", *FAILURES[failure], exchange=(steps, STATES))
    assert process.returncode == 1, process.stdout
    assert process.stdout.endswith(" 3\n")
    assert len(process.stderr.splitlines()) == 1


@pytest.mark.parametrize(("steps", "call"), [("euler", "Terminate"), ("completing", "CompletedIntegratorStep")])
def test_a_solver_that_diverges_is_an_error_at_the_end_at_the_latest(steps, call):
    """Trial points without finite results are no failure, so the FMU can refuse accepted ones only."""
    fmu = native_fmus.build_native_fmus() / "stickslip.fmu"
    process = run(fmu, {"k": 1e60, "x0": 1.0}, exchange=(steps, STATES))
    assert (process.returncode, process.stdout) == (1, f"fmi2{call} 3\n")
    assert "the solution diverges" in process.stderr


def test_a_run_without_failure_ends_well(fmus):
    native = native_fmus.build_native_fmus()
    ends = [run(fmu / "stickslip.fmu", {"m": 10.0}, {"F_ext": 5.0}) for fmu in (fmus, native)]
    for steps in "euler", "completing":
        ends.append(run(native / "stickslip.fmu", {"m": 10.0}, {"F_ext": 5.0}, exchange=(steps, STATES)))
    for process in ends:
        assert (process.returncode, process.stdout, process.stderr) == (0, "", "")


@pytest.mark.parametrize("failure", ["bad parameter", "bad input", "diverging run", "step backwards"])
def test_a_failure_of_a_python_fmu_looks_like_a_normal_end_as_its_page_states(fmus, failure):
    process = run(fmus / "stickslip.fmu", *FAILURES[failure])
    assert (process.returncode, process.stdout) == (0, "the FMU terminates\n")
    assert len(process.stderr.splitlines()) == 1
    with ZipFile(fmus / "stickslip.fmu") as archive:
        page = " ".join(archive.read("documentation/index.html").decode().split())
    assert "returns Discard, because the native layer of PythonFMU cannot return Error" in page
    assert "use the native FMU in them" in page


def test_a_host_without_the_python_library_cannot_load_a_python_fmu(fmus):
    process = run(fmus / "stickslip.fmu", LD_PRELOAD="")
    assert process.returncode == 2
    assert "undefined symbol: " in process.stderr
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
    process = run(tmp_path / "stickslip.fmu")
    assert (process.returncode, process.stdout) == (1, "fmi2DoStep 4\n")
