"""Ctrl-C and SIGTERM end every command at once: exit status, one line, nothing left behind, no new work."""

import concurrent.futures
import logging
import os
import select
import signal
import subprocess
import sys
import threading
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from functools import partial
from itertools import product

import commands
import pytest
from build_cache import ROOT
from logged_process import logged_process, wait_for_end, wait_for_line

from benchmarks.__main__ import main as BENCHMARKS
from harness.process import interrupt, interruptible_wait
from harness.process.interrupt import CommandInterruptedError, check_interrupt, defer_signals, interruptible
from harness.process.interruptible_wait import wait_for_any
from harness.process.subprocess_runner import SubprocessTimeoutError, run_subprocess

SLOW = 'title = "t"\nmodel = "pacejka"\noutputs = ["x", "v"]\ngrid = 5e-6\n[values]\nx_m = 0.001\n'
COMMANDS = {  # and a line of its log, once it has started
    "main": ([], "is being written"),
    "run": (["run", "slow.toml"], "friction-fmus-fmu-"),
    "precision": (["precision", "pacejka"], "precision/pacejka is being written"),
    "stability": (["stability", "stickslip"], "friction-fmus-child-"),
    "bench": (["bench"], "bench is being written"),
    "importers": (["importers"], "friction-fmus-child-"),
    "sweep": (["sweep", "pacejka", "--vary", "x_m=0.001:0.1:3000", "--workers", "1"], "of 3000 runs are finished"),
}


@pytest.fixture(autouse=True)
def logging_goes_on():
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "number"), [*product(COMMANDS, [signal.SIGINT]), ("run", signal.SIGTERM), ("sweep", signal.SIGTERM)]
)
def test_a_signal_ends_a_command_and_leaves_nothing_behind(workspace, command, number):
    """To the whole process group, as a terminal sends it."""
    (workspace / "temporary").mkdir()
    (workspace / "slow.toml").write_text(SLOW)
    arguments, line = COMMANDS[command]
    module = "benchmarks" if command in BENCHMARKS.commands else "harness"
    command_line = ("-m", module, *arguments, "--out", "out")
    with logged_process(workspace, *command_line, TMPDIR=str(workspace / "temporary")) as process:
        wait_for_line(process, line)
        os.killpg(process.pid, number)
        stdout, stderr = process.communicate(timeout=60)
    assert (process.returncode, stdout, stderr.count("\n")) == (128 + number, "", 1), stderr
    assert stderr.startswith(("Error: interrupted", "Error: terminated"))
    assert list((workspace / "temporary").iterdir()) == []
    files = [path.name for path in (workspace / "out").rglob("*") if path.is_file() or path.name.startswith(".")]
    if command == "sweep":
        assert [name for name in files if not name.endswith(".checkpoint")] == []  # finished runs are kept
    elif command == "main":
        assert [name for name in files if name.startswith(".")] == []  # completed scenes are intact
        assert len(list((workspace / "out").glob("*"))) < 8
    else:
        assert files == []


def test_a_context_is_exited_if_a_signal_arrives_during_entry():
    events = []

    @contextmanager
    def folder():
        try:
            yield
        finally:
            events.append("folder")

    def enter_folder():
        context = folder()
        context.__enter__()
        raise KeyboardInterrupt

    with pytest.raises(CommandInterruptedError) as error, interruptible():
        enter_folder()
    assert error
    assert events == ["folder"]


def test_an_interrupt_swallowed_by_a_callee_still_ends_the_command(monkeypatch):
    monkeypatch.setattr(interrupt, "RECEIVED_SIGNALS", [])
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)

    def swallow_interrupt():
        with interruptible():
            with suppress(KeyboardInterrupt):  # as a Python FMU may do
                signal.raise_signal(signal.SIGINT)
            raise RuntimeError("a step failed, for what it is worth")

    default = signal.default_int_handler, signal.SIG_DFL  # a shell lets background processes ignore Ctrl-C
    before = [signal.signal(number, handler) for number, handler in zip(interrupt.SIGNALS, default, strict=True)]
    try:
        with pytest.raises(CommandInterruptedError, match="interrupted") as error:
            swallow_interrupt()
        assert error.value.status == 130
        with pytest.raises(KeyboardInterrupt):
            check_interrupt()
    finally:
        for number, handler in zip(interrupt.SIGNALS, before, strict=True):
            signal.signal(number, handler)


def test_a_signal_during_a_protected_section_is_deferred_to_its_end(monkeypatch):
    monkeypatch.setattr(interrupt, "RECEIVED_SIGNALS", [])
    before = signal.signal(signal.SIGTERM, interrupt.handle_signal)
    starts = []

    def begin():
        with defer_signals():
            signal.raise_signal(signal.SIGTERM)
            starts.append("whole")

    try:
        with pytest.raises(KeyboardInterrupt):
            begin()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert starts == ["whole"]


@pytest.fixture
def handled_sigint(monkeypatch):
    """SIGINT, handled as in a command."""
    monkeypatch.setattr(interrupt, "RECEIVED_SIGNALS", [])
    before = signal.signal(signal.SIGINT, interrupt.handle_signal)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_signal_during_a_wait_is_raised_after_it(handled_sigint, monkeypatch):
    wait_results = []

    def interrupted_wait(*arguments, **options):
        signal.raise_signal(signal.SIGINT)
        wait_results.append(concurrent.futures.wait(*arguments, **options))
        return wait_results[0]

    monkeypatch.setattr(interruptible_wait, "wait", interrupted_wait)
    with pytest.raises(KeyboardInterrupt):
        wait_for_any([Future()])
    assert wait_results


def wait_until_signal(future, delay):
    """Wait for a future until a signal arrives; from a loop in a block `with`, Python 3.13 may let it escape."""
    signal.setitimer(signal.ITIMER_REAL, delay)
    while not interrupt.RECEIVED_SIGNALS:
        wait_for_any([future])


def test_signals_at_many_moments_of_a_wait_leave_no_lock_held(handled_sigint, monkeypatch):
    """In the library they would, and the awaited event could never end."""
    monkeypatch.setattr(interruptible_wait, "POLL_INTERVAL", 1e-4)
    before = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        for moment in range(300):
            interrupt.RECEIVED_SIGNALS.clear()
            future = Future()
            with suppress(KeyboardInterrupt):
                wait_until_signal(future, 1e-6 * (moment + 1))
            other = threading.Thread(target=future.cancel, daemon=True)
            other.start()
            other.join(timeout=10)
            assert not other.is_alive()
    finally:
        signal.signal(signal.SIGALRM, before)


def test_messages_larger_than_a_pipe_buffer_arrive_at_a_slow_reader():
    result = run_subprocess(["sh", "-c", "sleep 0.3; wc -c"], "a" * 200_000, timeout=60.0)
    assert (result.returncode, result.stdout.strip()) == (0, "200000")


def test_a_program_that_times_out_ends_with_all_its_children(tmp_path, monkeypatch):
    """Its time is over when it writes to a pipe."""
    os.mkfifo(tmp_path / "pipe")  # open for writing as long as a child lives
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    monkeypatch.setattr(
        "harness.process.subprocess_runner.monotonic", lambda: float(bool(select.select([reader], [], [], 0)[0]))
    )
    with pytest.raises(SubprocessTimeoutError, match=r"no answer after 0\.5 s") as error:
        run_subprocess(["sh", "-c", f"echo so far; exec 3> '{tmp_path}/pipe'; sleep 100 & echo >&3; wait"], timeout=0.5)
    assert error.value.process.stdout == "so far\n"
    os.set_blocking(reader, True)
    assert os.read(reader, 9) == b"\n"
    assert os.read(reader, 1) == b""  # the end of the pipe: no child lives
    os.close(reader)


@pytest.mark.parametrize("call", ["time.sleep, 100", "os.getcwd"], ids=["in a call", "between calls"])
def test_a_worker_exits_and_removes_its_files_after_its_parent_was_killed(tmp_path, call):
    (tmp_path / "temporary").mkdir()
    code = (
        "import os, time\nfrom harness.process.worker import WorkerPool\npool = WorkerPool(1)\n"
        "future = pool.submit(os.getpid)\nwhile not pool.wait_for_any([future]):\n    pass\n"
        f"pool.submit({call})\nprint(future.result(), flush=True)\ntime.sleep(100)"
    )
    with logged_process(tmp_path, "-c", code, TMPDIR=str(tmp_path / "temporary")) as parent:
        worker = os.pidfd_open(int(parent.stdout.readline()))
        parent.kill()
    wait_for_end(worker)
    assert not [*(tmp_path / "temporary").iterdir()]


def test_a_program_awaited_by_a_thread_ends_with_the_command(tmp_path, monkeypatch):
    monkeypatch.setattr(interrupt, "RECEIVED_SIGNALS", [])
    endings = []

    def wait():
        try:
            run_subprocess(["sleep", "100"])
        except KeyboardInterrupt:
            endings.append("here")

    thread = threading.Thread(target=wait)
    thread.start()
    interrupt.RECEIVED_SIGNALS.append(signal.SIGINT)
    thread.join(timeout=30)
    assert endings == ["here"]


def test_the_interrupt_message_survives_cleanup(monkeypatch):
    monkeypatch.setattr(interrupt, "RECEIVED_SIGNALS", [signal.SIGTERM])
    before = signal.signal(signal.SIGTERM, interrupt.handle_signal)

    def fail():
        try:
            raise CommandInterruptedError("half of it is kept")
        finally:
            with defer_signals():
                pass

    try:
        with pytest.raises(CommandInterruptedError, match="half of it is kept") as error:
            fail()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert error.value.status == 143


def test_a_swallowed_interrupt_is_raised_at_the_next_report_of_progress(workspace, monkeypatch):
    monkeypatch.setattr(interrupt, "RECEIVED_SIGNALS", [signal.SIGINT])
    with pytest.raises(KeyboardInterrupt):
        commands.harness(workspace, "run", "smd")
    assert not (workspace / "results").exists() or not list((workspace / "results").iterdir())


def interrupt_import(folder, library, arguments, number=signal.SIGINT):
    """Return exit status, output and messages of a command in which an imported library interrupts the process."""
    (folder / f"{library}.py").write_text(f"import os, time\nos.kill(os.getpid(), {number:d})\ntime.sleep(60)\n")
    result = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
        timeout=100,
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    return result.returncode, result.stdout, result.stderr


@pytest.mark.parametrize(
    ("arguments", "library"),
    [
        (["-m", "harness", "run", "smd"], "numpy"),
        (["-m", "benchmarks", "bench"], "numpy"),
        (["-m", "benchmarks", "bench"], "click"),
        ([str(ROOT / "build_fmus.py"), "smd"], "click"),
    ],
)
def test_a_signal_while_a_library_is_imported_ends_a_command_like_any_other(tmp_path, arguments, library):
    assert interrupt_import(tmp_path, library, arguments) == (130, "", "Error: interrupted\n")


@pytest.mark.parametrize(
    ("number", "sentence"), [(signal.SIGINT, "Error: interrupted\n"), (signal.SIGTERM, "Error: terminated\n")]
)
@pytest.mark.parametrize(
    "arguments", [["-m", "harness"], ["friction-fmus"], [str(ROOT / "build_fmus.py")], ["-m", "build_fmus"]]
)
def test_a_signal_during_the_first_imports_ends_a_command_like_any_other(tmp_path, arguments, number, sentence):
    (tmp_path / "friction-fmus").write_text("from harness.__main__ import main\nmain()\n")
    assert interrupt_import(tmp_path, "dataclasses", arguments, number) == (128 + number, "", sentence)
