"""bench: benchmarks with targets."""

import click

from .terminal import Terminal, result_options


@click.command()
@result_options
def bench(terminal: Terminal) -> None:
    """Run the benchmarks.  Each is measured against its target and against a peer in the same run.

    \b
    Example:
      friction-fmus bench
    """
    from ..studies.bench import study as work
    from ..studies.bench.table import benchmark_table

    selected = work.all_benchmarks()
    with terminal.progress(len(selected)) as report:
        benchmarks = work.run_benchmarks(selected, terminal.out, report)
    terminal.print_result(benchmarks, benchmark_table(benchmarks), folder=terminal.out / work.FOLDER)
