"""Start `python -I SCRIPT ARGUMENTS` by forking a process that has imported fmpy and scipy, which takes half a second.

The processes exit like Python, so that late memory errors show.
"""

import atexit
import gc
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

PRELOADED = ("fmpy.fmi2", "fmpy.fmi3", "fmpy.logging", "multiprocessing.queues", "scipy.integrate")
MAX_REQUEST = 1 << 17  # bytes of a request
temporary_folder = (
    None  # for the temporary files of the processes; removed by conftest.py, because many of them are killed
)


class ForkedProcess:
    """The part of subprocess.Popen that the tests need; the streams are open files."""

    def __init__(self, words, stdin, stdout, stderr, cwd=None):
        self.link, child_link = socket_pair()
        environment = os.environ | {"TMPDIR": str(temporary_folder or tempfile.gettempdir())}
        request = json.dumps([[*map(str, words)], str(cwd or os.getcwd()), environment]).encode()
        with child_link:
            socket.send_fds(_server(), [request], [file.fileno() for file in (child_link, stdin, stdout, stderr)])
        self.pid, self.returncode = int(self.link.recv(99)), None

    def wait(self, timeout=None):
        """Return the exit status, or None if the process still runs after `timeout` seconds."""
        if self.returncode is None and select.select([self.link], [], [], timeout)[0]:
            self.returncode = int(self.link.recv(99))
            self.link.close()
        return self.returncode

    def poll(self):
        return self.wait(0.0)

    def kill(self):
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)


def pipe():
    """Return the reading and the writing end of a pipe."""
    return [os.fdopen(end, mode, buffering=0) for end, mode in zip(os.pipe(), ("rb", "wb"), strict=True)]


def socket_pair():
    """Return the two ends of a socket that keeps message boundaries."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


@cache
def _server():
    """Start the server process and return the socket to it."""
    link, child_link = socket_pair()
    with child_link:
        call = [sys.executable, "-I", __file__, str(child_link.fileno())]
        null = subprocess.DEVNULL
        process = subprocess.Popen(
            call, stdin=null, stdout=null, pass_fds=[child_link.fileno()], start_new_session=True
        )
    atexit.register(process.wait, 30)
    atexit.register(link.close)
    return link


def serve_forks(line):
    """Fork twice for every request: the outer child reports the process id and exit status of the inner one.

    Returns the request in the inner child.
    """
    for name in PRELOADED:
        import_module(name)
    gc.freeze()  # reference counts would otherwise copy every memory page in each child
    while True:
        request, (*files,), *_ = socket.recv_fds(line, MAX_REQUEST, 4)
        if not request:
            os._exit(0)
        if not os.fork():
            break
        for file in files:
            os.close(file)
        with suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
    line.close()
    link, *streams = files
    if pid := os.fork():
        for file in streams:
            os.close(file)
        with suppress(OSError):  # the client has exited
            os.write(link, str(pid).encode())
            os.write(link, str(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])).encode())
        os._exit(0)
    os.close(link)
    for number, file in enumerate(streams):
        os.dup2(file, number)
        os.close(file)
    return json.loads(request)


def run_as(words, folder, environment):
    """Set up the process and run the script."""
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv, tempfile.tempdir = words, None
    main = sys.modules["__main__"] = ModuleType("__main__")
    main.__file__ = words[0]
    exec(compile(Path(words[0]).read_bytes(), words[0], "exec"), vars(main))


if __name__ == "__main__":
    run_as(*serve_forks(socket.socket(fileno=int(sys.argv[1]))))
