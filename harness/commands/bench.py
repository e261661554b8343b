"""bench: the numbers to reach."""

import click

from .terminal import Terminal, result_options


@click.command()
@result_options
def bench(terminal: Terminal) -> None:
    """Measure the numbers to reach, each beside what it is compared with in the same run.

    \b
    Example:
      python -m harness bench
    """
    from ..studies.bench import study as work
    from ..studies.bench.table import benchmark_table

    chosen = work.all_benchmarks()
    with terminal.progress(len(chosen)) as report:
        found = work.run_benchmarks(chosen, terminal.out, report)
    terminal.print_result(found, benchmark_table(found), folder=terminal.out / work.FOLDER)
