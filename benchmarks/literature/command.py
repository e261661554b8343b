"""literature: problems from the literature with known solutions."""

import click

from harness.commands.terminal import Terminal, result_options


@click.command()
@result_options
def literature(terminal: Terminal) -> None:
    """Solve problems from the literature, whose solutions are known, with every method, and two of them with peers.

    \b
    Example:
      python -m benchmarks literature
    """
    from .study import RESULT_FOLDER, literature_table, run_literature

    runs = run_literature(terminal.out)
    terminal.print_result(runs, literature_table(runs), folder=terminal.out / RESULT_FOLDER)
