"""Random calls of random_calls.py."""

import pytest


@pytest.mark.slow
def test_no_call_sequence_crashes_or_fails_silently(fmus):
    """Imported here, because hypothesis and what it collects take a second of each test process."""
    from hypothesis.stateful import run_state_machine_as_test

    from tests.hosts.random_calls import SHORT, RandomCalls

    machine = type("Machine", (RandomCalls,), {"folder": fmus})
    run_state_machine_as_test(machine, settings=SHORT)
    assert machine.worker.close() == 0
