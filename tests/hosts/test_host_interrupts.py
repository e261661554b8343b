"""An interrupt belongs to the host: it ends the step and reaches the host when the call returns. Runs in a clean
process."""

import json
import subprocess
import zipfile
from pathlib import Path

import pytest
from variants import slow_after
from worker_client import run_script_with_stderr

from tests.hosts.interrupted_host import HANDLERS
from tests.hosts.test_python_hosts import PYTHONS, interpreter

HOST = Path(__file__).with_name("interrupted_host.py")


@pytest.fixture
def fmu(fmus):
    return fmus / "smd.fmu"


@pytest.mark.parametrize("handler", slow_after(1, HANDLERS))
def test_an_interrupt_ends_a_step_and_reaches_the_host(fmu, handler):
    """The host gets the exception that its signal handler raised, once, and no later than at the end of the call."""
    answer, stderr = run_script_with_stderr(HOST, "interrupt_long_step", fmu, handler)
    arguments = {"KeyboardInterrupt": [], "SystemExit": [143], "Stop": ["enough", 3]}
    assert answer["reached"] == [handler, arguments[handler]]
    ((status, category, sentence),) = answer["log"]
    assert (status, category) == (3, "logStatusError")
    assert sentence == "the run was interrupted after t = 0.0 s; reset the FMU to run again"
    assert stderr == f"Smd (interrupted): {sentence}\n"
    assert answer["x"]
    assert answer["recovers"]


def test_an_interrupt_during_any_call_reaches_the_host(fmu):
    """Also if the signal is handled when a function of the FMU is entered, before its first line."""
    answer, stderr = run_script_with_stderr(HOST, "interrupt_short_steps", fmu, 150)
    assert answer == [["KeyboardInterrupt"], 150]
    assert all("was interrupted" in line for line in stderr.splitlines())


@pytest.mark.parametrize("version", PYTHONS)
def test_every_entry_point_is_protected_from_its_first_instruction(fmu, tmp_path, version):
    python = interpreter(version)
    if python is None:
        pytest.skip(f"there is no Python {version} here")
    with zipfile.ZipFile(fmu.with_name("stickslip.fmu")) as archive:
        archive.extractall(tmp_path)
    script = Path(__file__).with_name("interrupted_embedded.py")
    command = [python, "-I", script, tmp_path / "resources"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
    answers = json.loads(result.stdout)
    assert len(answers) >= 7
    for entry, (error, arguments, sentence) in answers.items():
        assert (error, arguments) == ("Stop", ["enough", 3]), entry
        assert "the run was interrupted" in sentence, entry
