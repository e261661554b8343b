"""An error is handled however standard error is lost: the step fails, and the log contains the message."""

from pathlib import Path

import pytest
from worker_client import run_script

from tests.hosts.closed_stderr import STDERR_FAILURES

*OBJECTS, _, _, _, _ = STDERR_FAILURES  # these can be tested one after another in one process
PROCESSES = [OBJECTS, *([failure] for failure in STDERR_FAILURES if failure not in OBJECTS)]


@pytest.mark.slow
@pytest.mark.parametrize("failures", PROCESSES, ids=lambda failures: failures[-1])
def test_an_error_survives_the_loss_of_standard_error(fmus, failures):
    """The process exits cleanly, too. The instance name is not ASCII."""
    answers = run_script(Path(__file__).with_name("closed_stderr.py"), "run_all", fmus / "pendulum.fmu", failures)
    assert len(answers) == len(failures)
    for answer in answers:
        assert answer["status"] == 2  # discard is all that the native layer can return
        assert answer["silent"]
        assert answer["recovered"]
        refusal, wrong_call = answer["log"]
        assert refusal[:2] == wrong_call[:2] == [3, "logStatusError"]
        assert "T_ext = nan N.m is refused" in refusal[2]
        assert "value reference 1000000 is refused" in wrong_call[2]
