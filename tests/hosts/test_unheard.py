"""A refusal survives the loss of standard error, in whatever way: the step fails, and the log has the sentence."""

import pytest
from driver import host
from unheard import WAYS

*OBJECTS, _, _, _, _ = WAYS
PROCESSES = [OBJECTS, *([way] for way in WAYS if way not in OBJECTS)]  # the ways that one process goes


@pytest.mark.parametrize("ways", PROCESSES, ids=lambda ways: ways[-1])
def test_a_refusal_survives_the_loss_of_standard_error(fmus, ways):
    """The process ends well, too; the name of the instance is no ASCII."""
    answers = host("unheard.py", "refused", fmus / "pendulum.fmu", ways)
    assert len(answers) == len(ways)
    for answer in answers:
        assert answer["status"] == 2  # discard, all that its layer can say
        assert answer["silent"]
        assert answer["recovered"]
        refusal, wrong_call = answer["log"]
        assert refusal[:2] == wrong_call[:2] == [3, "logStatusError"]
        assert "T_ext = nan N.m is refused" in refusal[2]
        assert "value reference 1000000 is refused" in wrong_call[2]
