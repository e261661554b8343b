"""Start a command whose log says how far it is, so that a test can act at a known state instead of after a time."""

import os
import select
import signal
import subprocess
import sys
from contextlib import contextmanager, suppress

from commands import ROOT, SUPPORT

# read by Python at its start; child processes do not inherit the pipe
LOG_TO_PIPE = """
import logging, os
logging.basicConfig(stream=os.fdopen(int(os.environ.pop("LOG_PIPE")), "w"), format="%(message)s")
for package in ("harness", "fmus"):
    logging.getLogger(package).setLevel("DEBUG")
"""


@contextmanager
def logged_process(folder, *arguments, site_code="", **environment):
    """Start Python with these arguments in a process group of its own; kill the whole group at the end.

    Parameters
    ----------
    folder : pathlib.Path
        The current directory of the process; it gets a file `sitecustomize.py`.
    arguments : str or pathlib.Path
        Arguments of Python.
    site_code : str
        Code that runs at the start of Python, before the log is opened.
    environment : str
        Additional variables of the environment.

    Yields
    ------
    subprocess.Popen
        The process, with pipes for its standard streams. Its attribute `log` iterates over the lines of its log.
    """
    (folder / "sitecustomize.py").write_text(site_code + LOG_TO_PIPE)
    read_end, write_end = os.pipe()
    path = os.pathsep.join(map(str, (folder, ROOT, SUPPORT)))
    try:
        process = subprocess.Popen(
            [sys.executable, *map(str, arguments)],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": path, "LOG_PIPE": str(write_end)} | environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            pass_fds=[write_end],
            start_new_session=True,
            # pytest ignores Ctrl-C if it runs in the background, and child processes would, too
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
    finally:
        os.close(write_end)
    with os.fdopen(read_end) as log, process:
        process.log = log
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def wait_for_line(process, text):
    """Return the next line of the log that contains a text; fail if the process ends before."""
    for line in process.log:
        if text in line:
            return line
    raise AssertionError(f"no line {text!r} in the log: {process.communicate()[1]}")


def wait_for_end(pid_descriptor):
    """Wait until a process has ended, given its descriptor of os.pidfd_open, and close that."""
    select.select([pid_descriptor], [], [])
    os.close(pid_descriptor)
