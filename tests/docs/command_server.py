"""A process that has imported what commands and pages import: it forks for each of them, which so starts at once.

`start_programs(folder)` writes the programs friction-fmus and run_blocks into a folder. They pass arguments, folder,
environment and streams to the server, and end with the exit status of its child process. Each command has a process of
its own, in which no other one ran. Its figures have only texts, because drawing takes most of a run.
"""

import atexit
import gc
import json
import os
import select
import socket
import subprocess
import sys
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from traceback import print_exc

ROOT = Path(__file__).parents[2]
PROGRAMS = {"friction-fmus": "harness.__main__", "run_blocks": "run_blocks"}  # and the module with their main()
CLIENT = """\
#!/bin/sh
'''exec' "{python}" -IS "$0" "$@"
' ''' # the path of Python may have blanks, which a first line of Python does not allow
import json, os, socket, sys

connection = socket.socket(socket.AF_UNIX)
connection.connect({address!r})
request = json.dumps([sys.argv, os.getcwd(), dict(os.environ)]).encode()
socket.send_fds(connection, [len(request).to_bytes(8, "little")], [0, 1, 2])
connection.sendall(request)
sys.exit(ord(connection.recv(1) or b"\\xff"))
"""


@contextmanager
def start_programs(folder):
    """Write the programs into a folder, and answer their calls while the context is open."""
    address = str(folder / "socket")
    for name in PROGRAMS:
        (folder / name).write_text(CLIENT.format(python=sys.executable, address=address))
        (folder / name).chmod(0o755)
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(str(ROOT / part) for part in ("", "docs", "tests/support")),
    }
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, __file__, address], cwd=folder, env=environment, **pipes) as server:
        assert server.stdout.readline() == b"ready\n"
        yield
        server.stdin.close()


def prepare():
    """Import what commands and pages import, read the sources of the runtime for builds, and replace the figures."""
    sys.argv[0] = "friction-fmus"  # by which harness.__main__ names the command
    names = ["build_fmus", "pandas", "run_blocks", "harness.__main__"]
    for package in ("harness", "fmus.compiler", "fmus.packaging", "fmus.page"):
        names += [module.name for module in walk_packages(import_module(package).__path__, f"{package}.")]
    for name in names:
        if not name.endswith(".worker_process"):  # which is a script
            import_module(name)
    import_module("fmus.compiler.lowering.lowered_modules").runtime_symbols()
    import_module("commands").blank_figures().start()
    gc.freeze()  # a collection in a child would copy the memory of the server


def serve(address):
    """Fork for each connection and send the exit status of each child process, until standard input ends."""
    connections = {}  # by the descriptor of the child process
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(address)
        listener.listen()
        print("ready", flush=True)
        while sys.stdin not in (readable := select.select([listener, sys.stdin, *connections], [], [])[0]):
            for child in connections.keys() & {*readable}:
                status = os.waitid(os.P_PIDFD, child, os.WEXITED).si_status
                with connections.pop(child) as connection:
                    connection.sendall(bytes([status]))
                os.close(child)
            if listener in readable:
                connection, _ = listener.accept()
                if (child := os.fork()) == 0:
                    run(connection)
                connections[os.pidfd_open(child)] = connection


def run(connection):
    """Run a program in this process, and end the process."""
    size, streams, _, _ = socket.recv_fds(connection, 8, 3)
    with connection.makefile("rb") as stream:
        sys.argv, folder, environment = json.loads(stream.read(int.from_bytes(size, "little")))
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    os.closerange(3, 100)
    sys.stdin, sys.stdout = open(0, closefd=False), open(1, "w", closefd=False)  # noqa: SIM115 - open until the end
    sys.stderr = open(2, "w", 1, errors="backslashreplace", closefd=False)  # noqa: SIM115
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    status = 0
    try:
        import_module(PROGRAMS[Path(sys.argv[0]).name]).main()
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        print_exc()
        status = 1
    atexit._run_exitfuncs()
    with suppress(OSError):  # a broken pipe, which the command has handled
        sys.stdout.flush()
    os._exit(status)  # the interpreter would free the modules, and so copy the memory of the server


if __name__ == "__main__":
    prepare()
    serve(sys.argv[1])
