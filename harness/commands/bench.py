"""bench: the numbers to reach."""

from pathlib import Path

import click

from .terminal import answer, progress, results


@click.command()
@results
def bench(out: Path, quiet: bool, as_json: bool) -> None:
    """Measure the numbers to reach, each beside what it is compared with in the same run.

    \b
    Example:
      python -m harness bench
    """
    from ..studies.bench import study as work
    from ..studies.bench.table import numbers

    chosen = work.measures()
    with progress(quiet or as_json, len(chosen)) as report:
        found = work.bench(chosen, out, report)
    answer(quiet, as_json, found, numbers(found), folder=out / work.FOLDER)
