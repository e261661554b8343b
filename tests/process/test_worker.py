"""Worker processes: a crash or a hang fails its own call, and another process does the next one."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from build_cache import ROOT
from logged_process import wait_for_end

from harness import HarnessError, SceneError
from harness.process import interrupt
from harness.process.worker import (
    Worker,
    WorkerCallError,
    WorkerDiedError,
    WorkerPool,
    WorkerStartError,
    WorkerTimeoutError,
    call_once,
)

MAX_OUTPUT_BYTES = 1_000_000  # that are kept of what a process prints

FUNCTIONS = """
import atexit, os, signal, sys, time
from harness import HarnessError, SceneError

class OddError(HarnessError):
    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")

def refuse(text):
    raise SceneError(text)

def refuse_oddly():
    raise OddError("this", "that")

def count(size, report):
    for i in range(size):
        time.sleep(0.25)
        report(i / size, f"step {i}")
    return size

def flood(size, report):
    for i in range(3):
        os.write(2, size * b".")
        time.sleep(0.25)
        report(i / 3)
    return size

def speak(text):
    print(text)
    os.write(2, b"and an error\\n")
    sys.stdin.read()
    return text

def echo(content):
    return content

def die_at_exit():
    atexit.register(os.kill, os.getpid(), 9)

def return_function():
    return lambda: 1
"""


@pytest.fixture
def functions(make_module):
    return make_module("functions_of_worker", FUNCTIONS)


@pytest.fixture
def worker():
    with Worker() as process:
        yield process


def wait(pool, future):
    while not pool.wait_for_any([future]):
        pass
    return future.result()


def test_values_return_unchanged(worker, functions):
    content = [0.1 + 0.2, 5e-324, float("inf"), None, "ä\n" * 200_000, {"a": (1, b"2")}]
    assert worker.call(functions.echo, content) == content
    array = np.arange(1e6)
    assert np.array_equal(worker.call(functions.echo, array), array)


def test_one_process_does_all_calls(worker):
    assert worker.call(os.getpid) == worker.call(os.getpid)


@pytest.mark.parametrize(
    ("function", "argument", "status"), [(sys.exit, 7, 7), (ctypes.string_at, 0, -signal.SIGSEGV), (os._exit, 0, 0)]
)
def test_a_crash_is_one_sentence_and_another_process_goes_on(worker, function, argument, status):
    first = worker.call(os.getpid)
    with pytest.raises(WorkerDiedError) as error:
        worker.call(function, argument)
    assert (error.value.status, str(error.value)) == (status, f"it ended with exit status {status}: no message")
    assert worker.call(os.getpid) != first


def test_a_hang_is_killed_and_another_process_goes_on(worker):
    first = worker.call(os.getpid)
    with pytest.raises(WorkerTimeoutError, match=r"no answer after 0\.5 s"):
        worker.call(time.sleep, 100, timeout=0.5)
    with pytest.raises(ProcessLookupError):
        os.kill(first, 0)
    assert worker.call(abs, -1) == 1


@pytest.mark.campaign
def test_a_progress_report_renews_the_time_limit(worker, functions, monkeypatch):
    """The clock of this process is the number of reports: a second passes with each."""
    reports = []
    monkeypatch.setattr("harness.process.worker.monotonic", lambda: float(len(reports)))
    assert worker.call(functions.count, 8, timeout=1.5, report=reports.append) == 8
    assert len(reports) > 5
    assert sorted(reports) == reports
    assert reports[1].note == "step 1"


def test_an_exception_does_not_end_the_process(worker, functions):
    first = worker.call(os.getpid)
    with pytest.raises(SceneError, match="too much"):
        worker.call(functions.refuse, "too much")
    with pytest.raises(HarnessError, match="this and that"):
        worker.call(functions.refuse_oddly)
    text = "ValueError: invalid literal for int() with base 10: 'x'"
    with pytest.raises(WorkerCallError) as error:
        worker.call(int, "x")
    assert (str(error.value), error.value.last_line) == (f"a worker failed: {text}", text)
    assert error.value.messages.startswith("Traceback")
    assert worker.call(os.getpid) == first


def test_a_result_that_cannot_be_sent_is_one_sentence(worker, functions):
    with pytest.raises(WorkerDiedError, match=r"local object .*lambda"):
        worker.call(functions.return_function)


def test_what_a_process_prints_belongs_to_its_call(worker, functions):
    worker.call(functions.speak, "one")
    assert sorted(worker.messages.split("\n")) == ["", "and an error", "one"]
    worker.call(abs, 1)
    assert worker.messages == ""


def test_no_more_than_the_largest_output_is_kept(worker, functions):
    worker.call(functions.flood, 2 * MAX_OUTPUT_BYTES // 5, report=lambda share: None)
    assert len(worker.messages) <= MAX_OUTPUT_BYTES


def test_a_signal_that_reached_another_thread_ends_a_call(worker, monkeypatch):
    first = worker.call(os.getpid)
    monkeypatch.setattr(interrupt, "RECEIVED_SIGNALS", [signal.SIGINT])
    with pytest.raises(KeyboardInterrupt):
        worker.call(time.sleep, 100)
    with pytest.raises(ProcessLookupError):
        os.kill(first, 0)


def test_a_process_that_died_after_its_reply_is_replaced(worker):
    first = worker.call(os.getpid)
    descriptor = os.pidfd_open(first)
    os.kill(first, signal.SIGKILL)
    wait_for_end(descriptor)
    assert worker.call(os.getpid) != first


def test_a_process_that_ends_badly_is_noticed_when_it_is_finished(worker, functions):
    worker.finish()  # nothing runs
    worker.call(abs, 1)
    worker.finish()
    worker.call(functions.die_at_exit)
    with pytest.raises(WorkerDiedError, match="it ended with exit status -9"):
        worker.finish()


def test_the_memory_of_a_process_is_limited():
    with Worker(memory=1 << 30) as worker:
        assert len(worker.call(bytearray, 1 << 20)) == 1 << 20
        with pytest.raises(WorkerCallError, match="MemoryError"):
            worker.call(bytearray, 1 << 30)


def test_a_module_that_cannot_be_imported_is_one_sentence(make_module):
    module = make_module("broken_module_of_worker", "def function():\n    pass")
    Path(module.__file__).write_text("import no_such_module")
    with pytest.raises(WorkerCallError, match="No module named 'no_such_module'"):
        call_once(module.function)


def test_a_process_that_cannot_start_is_one_sentence(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(WorkerStartError, match="a worker process cannot start: it ended with exit status 1"):
        call_once(abs, 1)
    with WorkerPool(2) as pool, pytest.raises(WorkerStartError, match="cannot start"):
        wait(pool, pool.submit(abs, 1))


def test_a_pool_does_more_calls_than_it_has_processes_and_replaces_those_that_die(functions):
    with WorkerPool(2) as pool:
        calls = [(abs, -i) for i in range(20)]
        calls[5:5] = [(os._exit, 3), (functions.refuse, "no"), (int, "x")]
        futures = [pool.submit(*call) for call in calls]
        for future in futures:
            while not future.done():
                pool.wait_for_any([future])
    assert [future.result() for future in futures if not future.exception()] == [*range(20)]
    errors = [future.exception() for future in futures if future.exception()]
    assert [*map(type, errors)] == [WorkerDiedError, SceneError, WorkerCallError]


def test_an_idle_process_of_a_pool_that_dies_is_replaced():
    with WorkerPool(1) as pool:
        first = wait(pool, pool.submit(os.getpid))
        os.kill(first, signal.SIGKILL)
        while pool.idle:  # until its end is noticed
            pool.wait_for_any([])
        assert wait(pool, pool.submit(os.getpid)) != first


def test_a_worker_killed_while_it_receives_data_is_replaced():
    with WorkerPool(1) as pool:
        pid = wait(pool, pool.submit(os.getpid))
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(WorkerDiedError, match="exit status -9"):
            wait(pool, pool.submit(len, bytes(10_000_000)))
        assert wait(pool, pool.submit(len, bytes(10_000_000))) == 10_000_000


def test_a_script_that_does_not_guard_its_code_uses_workers(tmp_path):
    """Workers import modules of functions, never the script that started them."""
    script = tmp_path / "script.py"
    script.write_text(
        "import os\nfrom harness.process.worker import call_once\nprint(call_once(os.getpid) != os.getpid())\n"
    )
    result = subprocess.run(
        [sys.executable, script], env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=60
    )
    assert (result.stdout, result.stderr) == ("True\n", "")
