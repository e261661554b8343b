"""hosts: run all kinds of FMUs in hosts that need an environment of their own."""

from pathlib import Path

import click

from harness.commands.terminal import Terminal, result_options


@click.command()
@click.option(
    "--environments",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("environments"),
    show_default=True,
    help="Folder of the virtual environments, which are created once: about 2.5 GB.",
)
@result_options
def hosts(environments: Path, terminal: Terminal) -> None:
    """Run the five models, Python and native, with and without --real-only, in gemseo-fmu, cofmupy and pathsim-fmi.

    Each host is installed in a virtual environment of its own. The table shows the largest error of the first output
    against the certified result, relative to its largest value, or a dash and the text of the failure.

    \b
    Examples:
      python -m benchmarks hosts --environments /tmp/hosts
    """
    from .matrix import HOSTS, failure_lines, make_table, run_matrix

    with terminal.progress(len(HOSTS)) as report:
        runs = run_matrix(environments, terminal.out, report)
    terminal.print_result(runs, make_table(runs), *failure_lines(runs), folder=terminal.out)
