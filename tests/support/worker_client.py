"""Run built FMUs in a clean process (worker.py); a crash or hang becomes a one-sentence AssertionError."""

import itertools
import json
import os
import select
import subprocess
import sys
import tempfile
from pathlib import Path

import build_cache

TIMEOUT = 120.0  # s, per request


def run_script(script, function, *arguments, **options):
    """Return the result of a function of a script, run in a process that must exit cleanly and print no
    errors."""
    answer, stderr = run_script_with_stderr(script, function, *arguments, **options)
    assert stderr == ""
    return answer


def run_script_with_stderr(script, function, *arguments, folder=None, timeout=300):
    """Return the result and standard error of a function of a script."""
    command = [*isolated_python(script), function, json.dumps(arguments, default=str)]
    result = subprocess.run(command, cwd=folder, env=environment(), capture_output=True, text=True, timeout=timeout)
    assert result.returncode == 0, f"exit status {result.returncode}: {result.stderr}"
    return json.loads(result.stdout), result.stderr


def isolated_python(script):
    """Return the command that runs a script, without the folders of the project on the path."""
    return [sys.executable, "-I", str(Path(__file__).parent / script)]


def environment():
    """Return the environment of a process: the folder of the test run holds its temporary files, as it may crash."""
    return os.environ | {"TMPDIR": str(build_cache.shared_folder)}


class FmiError(Exception):
    """An FMI call did not return OK."""

    def __init__(self, function, status):
        super().__init__(f"{function} returned status {status}")
        self.function, self.status = function, status


class FmpyError(Exception):
    """fmpy aborted a run."""


class Worker:
    """A process that runs FMUs; `alive` until it is closed, crashes or hangs."""

    def __init__(self):
        self.stderr_file = tempfile.TemporaryFile("a+b")  # noqa: SIM115 - lives as long as the process
        self.process = subprocess.Popen(
            isolated_python("worker.py"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.stderr_file,
            bufsize=0,
            cwd=tempfile.gettempdir(),
            env=environment(),
        )
        self.stderr_position, self.pending = 0, b""

    @property
    def alive(self):
        return self.process.poll() is None

    def call(self, instance, function, *arguments):
        """Send a request and return its value; raise FmiError if an FMI call fails, AssertionError otherwise."""
        try:
            self.process.stdin.write(json.dumps([instance, function, arguments]).encode() + b"\n")
            answer = json.loads(self._line(function))
        except BrokenPipeError:
            raise AssertionError(self._death_message(function)) from None
        if "refused" in answer:
            raise FmiError(*answer["refused"])
        assert "value" in answer, answer["failed"]
        return answer["value"]

    def _line(self, function):
        out = self.process.stdout.fileno()
        while b"\n" not in self.pending:
            if not select.select([out], [], [], TIMEOUT)[0]:
                self.process.kill()
                raise AssertionError(f"the FMU process hung for {TIMEOUT:.0f} s in {function}: {self.read_stderr()}")
            piece = os.read(out, 1 << 20)
            if not piece:
                raise AssertionError(self._death_message(function))
            self.pending += piece
        line, _, self.pending = self.pending.partition(b"\n")
        return line

    def _death_message(self, function):
        return f"the FMU process died in {function} with exit code {self.process.wait(10)}: {self.read_stderr()}"

    def read_stderr(self):
        """Return what was written to standard error since the last call."""
        self.stderr_file.seek(self.stderr_position)
        text = self.stderr_file.read()
        self.stderr_position += len(text)
        return text.decode()

    def instantiate(self, path, name="test"):
        return Instance(self, self.call(None, "instantiate", str(path), name))

    def exchange(self, path, name="test"):
        """Create an instance for model exchange."""
        return Instance(self, self.call(None, "exchange", str(path), name))

    def simulate(self, path, kind, **options):
        """Simulate with fmpy and return the columns; raise FmpyError if fmpy raises."""
        return self.simulate_and_count(path, kind, **options)[0]

    def simulate_and_count(self, path, kind, **options):
        """Simulate with fmpy and return the columns and the number of derivative evaluations."""
        answer = self.call(None, "simulate", str(path), {"fmi_type": kind, **options})
        if "error" in answer:
            raise FmpyError(answer["error"])
        return answer["columns"], answer["evaluations"]

    def modules(self):
        return self.call(None, "modules")

    def directory(self, path):
        """Return the folder to which an instantiated FMU was extracted."""
        return self.call(None, "directory", str(path))

    def close(self):
        """End the process and return its exit code."""
        self.process.stdin.close()
        code = self.process.wait(30)
        self.process.stdout.close()
        self.stderr_file.close()
        return code


class Instance:
    """An instance in the worker, with the methods of worker.Instance."""

    def __init__(self, worker, number):
        self.worker, self.number, self.is_freed = worker, number, False

    def __getattr__(self, function):
        return lambda *arguments: self.worker.call(self.number, function, *arguments)

    def get(self, *names):
        """Return the value of one variable, or a list for several."""
        values = self.worker.call(self.number, "get", names)
        return values[0] if len(names) == 1 else values

    def begin(self, values=None, start=0.0, stop=None, tolerance=None):
        """Set values, then go through initialisation."""
        self.set(values or {})
        self.setup(start, stop, tolerance)
        self.init()
        return self

    def run_with_changes(self, times, names, changes):
        """Like run, but set the values in `changes` at their times, after the row is read."""
        requests = []
        for t, end in itertools.pairwise([times[0], *sorted(changes), times[-1]]):
            requests.append([self.number, "set", [changes.get(t, {})]])
            requests.append([self.number, "run", [[s for s in times if t <= s <= end], names]])
        first, *others = self.worker.call(None, "batch", requests)[1::2]
        return first + [row for rows in others for row in rows[1:]]

    def free(self):
        self.is_freed = True
        self.worker.call(self.number, "free")
