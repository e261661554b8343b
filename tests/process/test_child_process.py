"""Child processes: a crash or a hang fails its own request, and another process answers the next one."""

import json
import os
import signal
import time

import pytest

from harness.errors import HarnessError
from harness.process import interrupt
from harness.process.child_process import MAX_OUTPUT_BYTES, ChildDiedError, ChildProcess, ChildTimeoutError, ask_once

SERVER = """
import ctypes, os, signal, sys, time
from harness.errors import HarnessError
from harness.process.child_process import RequestServer

def refuse(request):
    raise HarnessError(request)

def report(count):
    for i in range(count):
        time.sleep(0.25)
        server.report(i / count)
    return count

def flood(size):
    for i in range(3):
        os.write(2, size * b".")
        time.sleep(0.25)
        server.report(i / 3)
    return size

def speak(text):
    print(text)
    os.write(2, b"and an error\\n")
    sys.stdin.read()
    return text

ANSWERS = {
    "echo": lambda request: request,
    "process": lambda request: (os.getpid(), os.getcwd()),
    "hang": lambda request: time.sleep(100),
    "exit": sys.exit,
    "crash": lambda request: ctypes.string_at(0),
    "fail": int,
    "refuse": refuse,
    "report": report,
    "flood": flood,
    "speak": speak,
    "allocate": lambda request: len(bytearray(request)),
    "leave": lambda request: signal.setitimer(signal.ITIMER_REAL, 0.05) and None,
    "end badly": lambda request: __import__("atexit").register(os.kill, os.getpid(), 9) and None,
}

server = RequestServer(int(os.environ.get("SERVER_MEMORY", 0)))
server.serve(lambda request: ANSWERS[request[0]](request[1]))
"""


@pytest.fixture
def child(tmp_path, monkeypatch):
    """A process that answers lists of a word and an argument."""
    (tmp_path / "server.py").write_text(SERVER)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with ChildProcess("server") as process:
        yield process


def test_numbers_and_long_texts_return_unchanged(child):
    content = [0.1 + 0.2, 5e-324, float("inf"), None, "ä\n" * 200_000, {"a": [1, 2]}]
    assert child.ask(["echo", content]) == content
    assert str(child.ask(["echo", float("nan")])) == "nan"


def test_one_process_answers_all_requests(child):
    assert child.ask(["process", None]) == child.ask(["process", None])


@pytest.mark.parametrize(
    ("request_", "status", "text"),
    [
        (["exit", 7], 7, "it ended with exit status 7: no message"),
        (["crash", 0], -signal.SIGSEGV, "it ended with exit status -11: no message"),
        (["fail", "x"], 1, "it ended with exit status 1: ValueError: invalid literal for int() with base 10: 'x'"),
    ],
)
def test_a_crash_is_one_sentence_and_another_process_goes_on(child, request_, status, text):
    first, _ = child.ask(["process", None])
    with pytest.raises(ChildDiedError) as died:
        child.ask(request_)
    assert (died.value.status, str(died.value)) == (status, text)
    second, _ = child.ask(["process", None])
    assert first != second


def test_a_hang_is_killed_and_another_process_goes_on(child):
    first, _ = child.ask(["process", None])
    with pytest.raises(ChildTimeoutError, match=r"no answer after 0\.5 s"):
        child.ask(["hang", None], timeout=0.5)
    with pytest.raises(ProcessLookupError):
        os.kill(first, 0)
    assert child.ask(["echo", 1]) == 1


def test_a_progress_report_renews_the_time_limit(child):
    shares = []
    assert child.ask(["report", 8], timeout=1.5, report=shares.append) == 8
    assert len(shares) > 5
    assert sorted(shares) == shares


def test_an_error_is_raised_and_does_not_end_the_process(child):
    first = child.ask(["process", None])
    with pytest.raises(HarnessError, match="too much") as error:
        child.ask(["refuse", "too much"])
    assert type(error.value) is HarnessError
    assert child.ask(["process", None]) == first


def test_what_a_process_prints_belongs_to_its_request(child):
    child.ask(["speak", "one"])
    assert sorted(child.messages.split("\n")) == ["", "and an error", "one"]
    child.ask(["echo", 1])
    assert child.messages == ""


def test_no_more_than_the_largest_output_is_kept(child):
    child.ask(["flood", 2 * MAX_OUTPUT_BYTES // 5])
    assert len(child.messages) <= MAX_OUTPUT_BYTES


def test_a_signal_that_reached_another_thread_ends_a_request(child, monkeypatch):
    first, _ = child.ask(["process", None])
    monkeypatch.setattr(interrupt, "RECEIVED_SIGNALS", [signal.SIGINT])
    with pytest.raises(KeyboardInterrupt):
        child.ask(["hang", None], timeout=5.0)
    with pytest.raises(ProcessLookupError):
        os.kill(first, 0)


def test_a_process_that_died_after_its_reply_is_replaced(child):
    first, _ = child.ask(["process", None])
    child.ask(["leave", None])
    time.sleep(0.5)
    second, _ = child.ask(["process", None])
    assert first != second


def test_a_process_that_ends_badly_is_noticed_when_it_is_finished(child):
    child.ask(["echo", 1])
    child.finish()
    child.finish()  # nothing runs
    child.ask(["end badly", None])
    with pytest.raises(ChildDiedError, match="it ended with exit status -9"):
        child.finish()


def test_the_memory_of_a_process_is_limited(child, monkeypatch):
    monkeypatch.setenv("SERVER_MEMORY", str(1 << 30))
    assert child.ask(["allocate", 1 << 20]) == 1 << 20
    with pytest.raises(ChildDiedError, match="MemoryError"):
        child.ask(["allocate", 1 << 30])


def test_a_module_that_cannot_be_imported_is_one_sentence():
    with pytest.raises(ChildDiedError, match="No module named no_such_module"):
        ask_once("no_such_module", json.dumps({}), 60.0)
