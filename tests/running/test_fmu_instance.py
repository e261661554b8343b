"""Instances of one process do not share their log, and runs of one session do not depend on each other."""

from contextlib import suppress

import fmi3_fixtures
import numpy as np
import pytest
from external_fmus import build_external_fmus, edited_copy

from harness import HarnessError
from harness.running.fmu_instance import CALL_FAILURES, STATUS_NAMES, LogCapture
from harness.running.runner import open_instance, open_session
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


@pytest.mark.parametrize(
    ("fmu", "name", "value", "refused", "message"),
    [("smd", "m", 2.0, -1.0, "m = -1.0 kg is refused"), ("Faulty", "kind", 0, 2, "its binary crashed")],
)
def test_a_run_of_a_session_does_not_depend_on_earlier_runs(fmus, fmu, name, value, refused, message):
    """Neither in this process, nor in a worker, which is replaced when an external FMU crashes."""
    folder = fmus if fmu == "smd" else build_external_fmus()
    spec = RunSpec(folder / f"{fmu}.fmu", ("x",), stop=1.0)
    motions, failures = [], []
    with open_session(spec, (name,)) as session:
        for number in (value, refused, value, value):
            try:
                run = session.run([number])
            except HarnessError as error:
                failures.append(str(error))
            else:
                failures.append(run.failure)
                motions += [] if run.failure else [run["x"]]
    assert [bool(failure) for failure in failures] == [False, True, False, False]
    assert message in failures[1]
    assert np.ptp(motions[0]) > 0.0
    for motion in motions[1:]:
        np.testing.assert_array_equal(motion, motions[0])


@pytest.mark.parametrize("once", [False, True])
def test_an_fmu_for_one_instance_in_a_process_has_a_process_for_each_run(tmp_path, once):
    """Such an FMU may keep values of an earlier instance; here its output is the number of its process."""
    flag = "true" if once else "false"
    changes = {
        "resources/Gain.py": lambda text: (
            "import os\n" + text.replace("self.k * self.u + self.c", "float(os.getpid())")
        ),
        "modelDescription.xml": lambda text: text.replace('OncePerProcess="false"', f'OncePerProcess="{flag}"'),
    }
    fmu = edited_copy(build_external_fmus() / "Gain.fmu", tmp_path / "Gain.fmu", changes)
    with open_session(RunSpec(fmu, ("y",), stop=1.0), ("k",)) as session:
        processes = {session.run([k])["y"][-1] for k in (1.0, 2.0)}
    assert len(processes) == (2 if once else 1)
