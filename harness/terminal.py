"""What the commands share at the terminal: options, the progress bar, numbers as JSON."""

import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from io import TextIOWrapper
from math import isfinite
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from .interrupt import check
from .unpacked import temporary

OUT = click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("results"),
    show_default=True,
    help="Folder that receives one folder for each scene.",
)
QUIET = click.option("--quiet", is_flag=True, help="Print errors only.")
JSON = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else.")


def prepare() -> None:
    """Let standard output take every letter, a closed stream take everything, and temporary files lie where every
    library finds them."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - as long as the process
        elif isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    tempfile.tempdir = os.environ["TMPDIR"] = str(temporary())


@contextmanager
def progress(quiet: bool, total: int) -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error, gone at the end; yields what tells it the present scene and its share done."""
    console = Console(file=sys.stderr)  # this very stream: runs redirect sys.stderr
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    if quiet or not console.is_terminal:  # a bar that is told to be silent writes an empty line, until rich 14.2
        yield lambda name, share: check()
        return
    with Progress(*columns, console=console, transient=True, redirect_stderr=False) as bar:
        task = bar.add_task("", total=total)
        done: list[str] = []

        def report(name: str, share: float) -> None:
            check()
            if name not in done:
                done.append(name)
            bar.update(task, description=name, completed=len(done) - 1 + share)

        yield report


def as_text(result: Any) -> str:
    """A result of dataclasses, dicts, lists, texts and numbers as JSON in ASCII, which every terminal and file takes;
    what is not finite is null there."""
    return json.dumps(finite(result), indent=1, allow_nan=False)


def finite(result: Any) -> Any:
    """The result with None for numbers that JSON does not know."""
    if is_dataclass(result):
        return {each.name: finite(getattr(result, each.name)) for each in fields(result)}
    if isinstance(result, dict):
        return {name: finite(value) for name, value in result.items()}
    if isinstance(result, list | tuple):
        return [finite(value) for value in result]
    return None if isinstance(result, float) and not isfinite(result) else result
