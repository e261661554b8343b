"""Hosts of FMUs: processes as `python -I SCRIPT ARGUMENTS` begins them, but forked from one that has loaded what they
load, for that takes half a second, and there are hundreds.  They end as Python does, so that late damage to memory
shows."""

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
MAX_REQUEST = 1 << 17  # bytes of what is asked
temporary_folder = None  # the folder of their temporary files, which somebody else removes: many are ended from outside


class ForkedProcess:
    """What is needed here of a subprocess.Popen; its streams are open files."""

    def __init__(self, words, stdin, stdout, stderr, cwd=None):
        self.link, theirs = socket_pair()
        environment = os.environ | {"TMPDIR": str(temporary_folder or tempfile.gettempdir())}
        asked = json.dumps([[*map(str, words)], str(cwd or os.getcwd()), environment]).encode()
        with theirs:
            socket.send_fds(_server(), [asked], [file.fileno() for file in (theirs, stdin, stdout, stderr)])
        self.pid, self.returncode = int(self.link.recv(99)), None

    def wait(self, timeout=None):
        """The exit status, or None if the process has not ended within so many s."""
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
    """Its end to read from and its end to write to."""
    return [os.fdopen(end, mode, buffering=0) for end, mode in zip(os.pipe(), ("rb", "wb"), strict=True)]


def socket_pair():
    """The two ends of a line, on which messages stay apart."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


@cache
def _server():
    """The line to the process from which the others are forked."""
    mine, theirs = socket_pair()
    with theirs:
        call = [sys.executable, "-I", __file__, str(theirs.fileno())]
        null = subprocess.DEVNULL
        process = subprocess.Popen(call, stdin=null, stdout=null, pass_fds=[theirs.fileno()], start_new_session=True)
    atexit.register(process.wait, 30)
    atexit.register(mine.close)
    return mine


def serve_forks(line):
    """Fork twice for every message: returns what was asked in the second process; the first tells who that is, and how
    it ended."""
    for name in PRELOADED:
        import_module(name)
    gc.freeze()  # else whoever is forked copies all that there is, to count who refers to it
    while True:
        asked, (*files,), *_ = socket.recv_fds(line, MAX_REQUEST, 4)
        if not asked:
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
        with suppress(OSError):  # whoever asked is gone
            os.write(link, str(pid).encode())
            os.write(link, str(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])).encode())
        os._exit(0)
    os.close(link)
    for number, file in enumerate(streams):
        os.dup2(file, number)
        os.close(file)
    return json.loads(asked)


def run_as(words, folder, environment):
    """What a process is that was started so."""
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv, tempfile.tempdir = words, None
    main = sys.modules["__main__"] = ModuleType("__main__")
    main.__file__ = words[0]
    exec(compile(Path(words[0]).read_bytes(), words[0], "exec"), vars(main))


if __name__ == "__main__":
    run_as(*serve_forks(socket.socket(fileno=int(sys.argv[1]))))
