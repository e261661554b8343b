"""Instances of one process do not share their log."""

from contextlib import suppress

import fmi3_fixtures
import pytest

from harness.running.fmu_instance import CALL_FAILURES, STATUS_NAMES, LogCapture
from harness.running.runner import open_instance
from harness.scenes.run_spec import RunSpec


def check_logs(folder):
    """Refuse a value in one of two instances."""
    spec = RunSpec(folder / "coulomb.fmu")
    with open_instance(spec) as one, open_instance(spec) as other:
        with suppress(*CALL_FAILURES):
            one.set(one.variables["m"], -1.0)
            one.initialize([], 0.0, 1.0)
            one.step(0.0, 0.1)
        assert one.log.error_message.startswith("m = -1.0 kg is refused")
        assert list(other.log.messages) == []


def test_a_message_is_in_the_log_of_its_instance(backend_fmus):
    check_logs(backend_fmus)


def test_a_later_warning_does_not_hide_an_error():
    log = LogCapture()
    log.add(STATUS_NAMES.index("Error"), b"m is refused")
    log.add(STATUS_NAMES.index("Warning"), b"the step is long")
    assert log.error_message == "m is refused"


@pytest.mark.slow
def test_a_message_of_fmi3_is_in_the_log_of_its_instance():
    check_logs(fmi3_fixtures.build_fmi3_fmus())
