"""An error is handled however standard error is lost: the step fails, and the log contains the message."""

import pytest
from closed_stderr import STDERR_FAILURES
from worker_client import run_script

*OBJECTS, _, _, _, _ = STDERR_FAILURES
PROCESSES = [
    OBJECTS,
    *([way] for way in STDERR_FAILURES if way not in OBJECTS),
]  # can be tested one after another in one process


@pytest.mark.slow
@pytest.mark.parametrize("ways", PROCESSES, ids=lambda ways: ways[-1])
def test_an_error_survives_the_loss_of_standard_error(fmus, ways):
    """The process exits cleanly, too. The instance name is not ASCII."""
    answers = run_script("closed_stderr.py", "run_all", fmus / "pendulum.fmu", ways)
    assert len(answers) == len(ways)
    for answer in answers:
        assert answer["status"] == 2  # discard is all that the native layer can return
        assert answer["silent"]
        assert answer["recovered"]
        refusal, wrong_call = answer["log"]
        assert refusal[:2] == wrong_call[:2] == [3, "logStatusError"]
        assert "T_ext = nan N.m is refused" in refusal[2]
        assert "value reference 1000000 is refused" in wrong_call[2]
