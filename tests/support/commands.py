"""Run `python -m harness`, `python -m benchmarks` and `python build_fmus.py`, in this process or in one of its own."""

import os
import subprocess
import sys
from contextlib import chdir, nullcontext
from contextvars import copy_context
from pathlib import Path
from unittest.mock import patch
from xml.sax.saxutils import escape

from click.testing import CliRunner

import build_fmus
from benchmarks.__main__ import main as benchmark_commands
from harness.__main__ import exit_on_error, run_arguments
from harness.commands import commands

SUPPORT = Path(__file__).parent
ROOT = SUPPORT.parents[1]
TIMEOUT = 300.0  # s
TEXTS_ONLY = '<svg xmlns="http://www.w3.org/2000/svg"><style></style>{}</svg>'


class Program:
    """A command with the error messages and exit statuses of its script."""

    def __init__(self, command, name):
        self.command, self.name = command, name

    def main(self, args, prog_name):
        sys.stdout.reconfigure(errors="replace")  # as `prepare_process` does
        with exit_on_error():
            copy_context().run(run_arguments, self.command, prog_name, args)


HARNESS, BUILD = Program(commands, "python -m harness"), Program(build_fmus.main, "build_fmus.py")
BENCHMARKS = Program(benchmark_commands, "python -m benchmarks")


def harness(folder, *arguments, text="", figures=False, **environment):
    """Run `python -m harness` in this process, in a folder, and return its exit status and output.

    It reads `text` from standard input. Its figures have only texts unless `figures` is true, because saving them takes
    most of a run.
    """
    with nullcontext() if figures else blank_figures():
        return _run_here(HARNESS, folder, arguments, text, environment)


def benchmarks(folder, *arguments, text="", **environment):
    """Run `python -m benchmarks` in this process, in a folder, and return its exit status and output."""
    return _run_here(BENCHMARKS, folder, arguments, text, environment)


def build(*arguments, folder=ROOT, **environment):
    """Run `python build_fmus.py` in this process, in a folder, and return its exit status and output."""
    return _run_here(BUILD, folder, arguments, "", environment)


def blank_figures():
    """Save only the texts of figures, without tick labels, while the returned context is open."""

    def save_texts(figure, path):
        from matplotlib.ticker import FixedFormatter, FuncFormatter

        from harness.results.style import find_texts

        lines = [line for text in find_texts(figure) if text.get_visible() for line in text.get_text().splitlines()]
        for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
            if isinstance(axis.get_major_formatter(), FixedFormatter | FuncFormatter):  # given tick labels
                lines += [label.get_text() for label in axis.get_ticklabels()]
        path.write_text(TEXTS_ONLY.format("".join(f"<text>{escape(line)}</text>" for line in lines)))

    return patch("harness.results.style.save_figure", save_texts)


def _run_here(program, folder, arguments, text, environment):
    runner = CliRunner(env=environment, catch_exceptions=False, capture="fd")
    words = to_words(arguments)
    with chdir(folder), patch("sys.argv", [program.name, *words]):
        result = runner.invoke(program, words, text, prog_name=program.name)
    return subprocess.CompletedProcess(arguments, result.exit_code, result.stdout, result.stderr)


def to_words(arguments):
    """Return the words of a command line; a tuple or list among them is a test that forgot to unpack it."""
    assert not any(isinstance(argument, (tuple, list)) for argument in arguments), arguments
    return [*map(str, arguments)]


def run_process(folder, *arguments, module="harness", text="", **environment):
    """Run `python -m harness`, or another module, in a process of its own and return the finished process."""
    return run_python(folder, "-m", module, *arguments, text=text, **{"PYTHONPATH": str(ROOT), **environment})


def run_python(folder, *arguments, text="", **environment):
    """Run Python with these arguments in a process of its own, which finds the project and the folder of this file, and
    return the finished process."""
    return subprocess.run(
        [sys.executable, *to_words(arguments)],
        input=text,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(SUPPORT)]), **environment},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
