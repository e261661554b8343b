"""Run `python -m harness` and `python build_fmus.py` in child processes, as a user does.

The child is forked from a server process that has already imported both, because the imports take about a second and
the tests run hundreds of commands. `fresh` starts a new interpreter instead; commands/test_runs.py checks that both
give the same result. Modules that a command runs in processes of its own are forked too. Drawing takes most of a run:
`blank` skips layout and drawing, `blank=UNPLOTTED` skips plotting too.
"""

import atexit
import gc
import json
import multiprocessing
import os
import runpy
import select
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
from contextlib import contextmanager, suppress
from functools import cache, partial
from importlib import import_module
from multiprocessing import resource_tracker
from pathlib import Path
from pkgutil import walk_packages
from types import SimpleNamespace

SUPPORT = Path(__file__).parent
ROOT = SUPPORT.parents[1]
TIMEOUT = 300.0  # s
LAZY_IMPORTS = ("dask.array", "fmpy.validation", "rich.progress", "scipy.io", "xarray")  # imported where they are used
FORKED_MODULES = (
    "build_fmus",
    "harness.running.",
    "harness.studies.coupled.",
)  # modules that commands run in processes of their own
UNPLOTTED = "unplotted"
BLANK = '<svg xmlns="http://www.w3.org/2000/svg"><style></style></svg>'


def harness(folder, *arguments, base=os.environ, fresh=False, blank=False, text="", module="harness", **environment):
    """Run a command and return the finished process. It reads `text` from standard input."""
    words, environment = [*map(str, arguments)], {**base, "PYTHONPATH": str(ROOT)} | environment
    if not fresh:
        return _server().run(module, words, str(folder), environment, text, blank)
    command = [sys.executable, "-m", module, *words]
    options = {"cwd": folder, "env": environment, "capture_output": True, "text": True, "timeout": TIMEOUT}
    return subprocess.run(command, input=text, **options)


def build(*arguments, folder=ROOT, **environment):
    """Run the build command and return the finished process."""
    return harness(folder, *arguments, module="build_fmus", **environment)


@cache
def _server():
    server = ForkServer()
    atexit.register(server.close)
    return server


class ForkServer:
    """The process from which all commands are forked."""

    def __init__(self):
        self.temporary_folder = tempfile.TemporaryDirectory()
        self.files = [Path(self.temporary_folder.name, name) for name in ("in", "out", "err")]
        command, environment = [sys.executable, __file__], os.environ | {"PYTHONPATH": str(ROOT)}
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            command,
            stdin=pipe,
            stdout=pipe,
            text=True,
            env=environment,
            cwd=self.temporary_folder.name,
            start_new_session=True,
        )

    def run(self, module, words, folder, environment, text, blank):
        for file in self.files:
            file.write_text(text if file.name == "in" else "")
        state = {"words": words, "folder": folder, "environment": environment, "files": [*map(str, self.files)]}
        print(json.dumps([module, blank, state]), file=self.process.stdin, flush=True)
        if not select.select([self.process.stdout], [], [], TIMEOUT)[0]:
            os.killpg(self.process.pid, signal.SIGKILL)
            _server.cache_clear()
            raise AssertionError(f"{module} {' '.join(words)} did not end within {TIMEOUT:.0f} s")
        status = int(self.process.stdout.readline())
        return subprocess.CompletedProcess(words, status, *(file.read_bytes().decode() for file in self.files[1:]))

    def close(self):
        self.process.stdin.close()
        self.process.wait(30)
        self.process.stdout.close()
        self.temporary_folder.cleanup()


def serve():
    """Import everything, then fork for every request and answer with the exit status."""
    crew = import_module("harness.process.worker_pool")
    crew.process_context = lambda preload: multiprocessing.get_context(
        "fork"
    )  # no fork server has to import everything again
    resource_tracker.ensure_running()  # commands share this tracker instead of starting their own
    packages = [(import_module(name).__path__, f"{name}.") for name in ("harness", "fmus.packaging")]
    for name in (*(module.name for package in packages for module in walk_packages(*package)), *LAZY_IMPORTS):
        with suppress(ImportError):  # optional package that is not installed
            if not name.endswith("__main__"):
                import_module(name)
    import_module("fmus.packaging.lowering").lowered_model("smd")  # caches the sources that every model is lowered from
    from harness.process import subprocess_runner as asking
    from harness.results import provenance, style

    provenance.write_provenance(Path(), ())  # caches package and system versions
    asking.subprocess = SimpleNamespace(**{**vars(subprocess), "Popen": ForkedPopen})
    with style.open_figure(Path(os.devnull), 1.0, 1.0) as figure:  # imports matplotlib and loads its fonts
        figure.subplots().set_title("a title")
    drawing = [item for item in sys.modules.values() if getattr(item, "open_figure", None) is style.open_figure]
    gc.freeze()  # reference counts would otherwise copy every memory page in each child
    for line in sys.stdin:
        child = os.fork()
        if not child:
            module, blank, state = json.loads(line)
            set_process_state(**state)
            if blank:
                for item in drawing:
                    item.open_figure = partial(stub_sheet, None if blank == UNPLOTTED else style.Figure)
            run(module)
            return
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


class SkipPlotting(Exception):
    """Raised by any attribute access of a figure that is not plotted."""

    def __getattr__(self, name):
        raise self


@contextmanager
def stub_sheet(kind, path, width, height, layout=None):
    """Replace `style.sheet`: plot without layout and drawing, or do not plot at all if `kind` is None."""
    with suppress(SkipPlotting):
        yield kind((width, height)) if kind else SkipPlotting()
    path.write_text(BLANK)


class ForkedPopen(subprocess.Popen):
    """Replace Popen: fork this process to run a module of the project instead of starting an interpreter."""

    def __init__(self, command, env, **how):
        def answer():
            os.closerange(3, 1024)  # Popen waits for its pipe to close; the limit may be a thousand million descriptors
            atexit._clear()  # skip the exit handlers of the parent
            resource_tracker._resource_tracker._fd = None
            for number, default in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
                signal.signal(number, default)
            sys.stdout, sys.stderr = (open(number, "w", closefd=False) for number in (1, 2))  # noqa: SIM115
            try:
                set_process_state(words, os.getcwd(), env, ())
                sys.modules.pop(module, None)
                run(module)
            except BaseException:
                traceback.print_exc()
            sys.stderr.flush()
            os._exit(1)

        module, words = command[2] if command[1:2] == ["-m"] else "", command[3:]
        ours = module.startswith(FORKED_MODULES)
        super().__init__(command, env=env, preexec_fn=answer if ours else None, **how)


def set_process_state(words, folder, environment, files):
    """Set up working directory, environment, arguments and streams like those of a new process."""
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv, sys.path[0], tempfile.tempdir = ["", *words], folder, None
    for number, file in enumerate(files):
        opened = os.open(file, os.O_RDWR)
        os.dup2(opened, number)
        os.close(opened)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115 - drop what the parent has read ahead


def run(module):
    """Run a module like Python does, but exit without tearing down the imported modules, which takes longer."""
    status = 0
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if not isinstance(end.code, int | None):
            raise
        status = end.code or 0
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    serve()
