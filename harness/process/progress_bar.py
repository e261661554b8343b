"""Progress bar of a function in a terminal or a notebook, shown for what takes longer than two seconds."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from io import UnsupportedOperation
from time import perf_counter
from typing import Any

DELAY = 2.0  # s


@contextmanager
def show_progress(title: str) -> Iterator[Callable[[float], None]]:
    """Yield a function that takes the finished share and shows it; it does nothing without a terminal or notebook."""
    from rich.console import Console

    console = Console(file=sys.stderr)
    if not (console.is_terminal or console.is_jupyter):
        yield lambda share: None
        return
    start = perf_counter()
    tasks: list[Any] = []
    with ExitStack() as stack:
        if not console.is_jupyter:  # runs redirect standard error
            try:
                copy = os.fdopen(os.dup(sys.stderr.fileno()), "w", errors="replace")
                console = Console(file=stack.enter_context(copy), force_terminal=True)
            except (OSError, UnsupportedOperation):  # not a file
                pass
        bar = make_bar(console)

        def report(share: float) -> None:
            if not tasks and perf_counter() - start > DELAY:
                stack.enter_context(bar)
                tasks.append(bar.add_task(title, total=1.0))
            for task in tasks:
                bar.update(task, completed=share)

        yield report


def make_bar(console: Any) -> Any:
    """Return a bar of rich that disappears when it ends."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    return Progress(*columns, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
