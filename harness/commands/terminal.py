"""What the commands share at the terminal: options, the progress bar, tables, numbers as JSON.

What takes long to import is imported where it is used: help and small commands start at once.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import wraps
from io import TextIOWrapper
from math import isfinite
from pathlib import Path
from typing import Any

import click

from ..errors import HarnessError
from ..process.interrupt import check_interrupt
from ..process.temporary_directory import temporary_root


def out_option(text: str) -> Callable[..., Any]:
    """The option that names the folder of results, and what is said of it."""
    folder = click.Path(file_okay=False, path_type=Path)
    return click.option("--out", type=folder, default=Path("results"), show_default=True, help=text)


default_out_option = out_option("Folder that receives one folder for each scene.")
quiet_option = click.option("--quiet", is_flag=True, help="Print errors only.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else.")


def allow_overwrite(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    """Say so where results are written."""
    from ..results.folder import OVERWRITE as allowed

    allowed.set(allowed.get() or wanted)


overwrite_option = click.option(
    "--overwrite",
    is_flag=True,
    expose_value=False,
    callback=allow_overwrite,
    help="Replace the result of something else.",
)


def result_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of all commands that have results: they become its `terminal`."""

    @wraps(command)
    def told(out: Path, quiet: bool, as_json: bool, **others: Any) -> Any:
        return command(terminal=Terminal(quiet, as_json, out), **others)

    return default_out_option(overwrite_option(quiet_option(json_option(told))))


class FiniteFloat(click.FloatRange):
    """A finite number, in a range or not; click lets NaN through, which is in no range."""

    name = "number"

    def _describe_range(self) -> str:
        """Of a range without ends click says that it ends at None."""
        return "" if self.min is self.max is None else super()._describe_range()

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        return number


FINITE, POSITIVE = FiniteFloat(), FiniteFloat(min=0, min_open=True)
STOP_OPTION = click.option("--stop", type=FINITE, help="Stop time in s (the FMU's own).")
EXTERNAL_FMU_OPTIONS = (  # what is said of an FMU that does not show its solver's steps
    click.option("--tolerance", type=POSITIVE, default=1e-6, show_default=True, help="To which it is run, relative."),
    click.option("--exchange", is_flag=True, help="Run it by model exchange, where it offers both."),
    click.option("--lenient", is_flag=True, help="Run it though it breaks the standard."),
    click.option("--timeout", type=POSITIVE, default=60.0, show_default=True, help="For one call of it, in s."),
)


def run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of commands that run anyone's FMUs: fields of a Specification."""
    for option in reversed((STOP_OPTION, *EXTERNAL_FMU_OPTIONS)):
        command = option(command)
    return command


def prepare_process() -> None:
    """Let standard output take every letter, a closed stream be an empty one, temporary files lie where every library
    finds them, and numpy's products be summed by one thread: several sum in another order, and mostly wait."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for name in ("stdin", "stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "r+", encoding="utf-8"))  # noqa: SIM115 - as long as the process
        elif isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    tempfile.tempdir = os.environ["TMPDIR"] = str(temporary_root())


@contextmanager
def progress(quiet: bool, total: int) -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error, gone at the end; yields what tells it the present scene and its share done."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(file=sys.stderr)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    if quiet or not console.is_terminal:  # a bar that is told to be silent writes an empty line, until rich 14.2
        yield lambda name, share: check_interrupt()
        return
    with (
        os.fdopen(os.dup(sys.stderr.fileno()), "w", errors="replace") as console.file,  # runs redirect standard error
        Progress(*columns, console=console, transient=True, redirect_stderr=False) as bar,
    ):
        task = bar.add_task("", total=total)
        done: list[str] = []

        def report(name: str, share: float) -> None:
            check_interrupt()
            if name not in done:
                done.append(name)
            bar.update(task, description=name, completed=len(done) - 1 + share)

        yield report


def print_json(result: Any) -> None:
    """Print a result as JSON."""
    from ..results.files import to_json

    click.echo(to_json(result))


@dataclass(frozen=True)
class Terminal:
    """How a command answers: errors only if `quiet`, JSON only if `as_json`; `out`: the folder of its results."""

    quiet: bool
    as_json: bool
    out: Path = Path()

    def progress(self, total: int) -> AbstractContextManager[Callable[[str, float], None]]:
        return progress(self.quiet or self.as_json, total)

    def print_result(self, result: Any, *shown: Any, folder: Path | None = None, failed: Iterable[str] = ()) -> None:
        """Print a result as JSON, or, unless all is to be quiet, the tables and sentences that people are shown; last
        what is said of the older result in its folder, and where that is.  HarnessError if something has `failed`."""
        from rich.console import Console
        from rich.table import Table

        if self.as_json:
            print_json(result)
        elif not self.quiet:
            console = Console(markup=False, highlight=False)  # units and names have brackets, too
            for each in shown:
                for column in each.columns if isinstance(each, Table) else ():
                    column.overflow = "fold"  # a name that is cut is not told
                console.print(each)
            if folder:
                from ..results.provenance import replacement_note

                console.print("\n".join(filter(None, (replacement_note(folder), f"Results in {folder}"))))
        if sentences := [*failed]:
            raise HarnessError("\n".join(sentences))
