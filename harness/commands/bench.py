"""bench: the numbers to reach."""

import click

from .terminal import Terminal, results


@click.command()
@results
def bench(terminal: Terminal) -> None:
    """Measure the numbers to reach, each beside what it is compared with in the same run.

    \b
    Example:
      python -m harness bench
    """
    from ..studies.bench import study as work
    from ..studies.bench.table import numbers

    chosen = work.measures()
    with terminal.progress(len(chosen)) as report:
        found = work.bench(chosen, terminal.out, report)
    terminal.answer(found, numbers(found), folder=terminal.out / work.FOLDER)
