"""bench: benchmarks with targets."""

import click

from harness.commands.terminal import Terminal, result_options


@click.command()
@result_options
def bench(terminal: Terminal) -> None:
    """Run the benchmarks.  Each result is compared with its target and with a peer in the same run.

    \b
    Example:
      python -m benchmarks bench
    """
    from . import study
    from .study import benchmark_table

    functions = study.all_benchmarks()
    with terminal.progress(len(functions)) as report:
        benchmarks = study.run_benchmarks(functions, terminal.out, report)
    terminal.print_result(benchmarks, benchmark_table(benchmarks), folder=terminal.out / study.FOLDER)
