"""rivals: the same scenes in other engines."""

import click

from harness.commands.terminal import POSITIVE, Terminal, result_options


@click.command()
@click.argument("names", metavar="[RIVAL]...", nargs=-1)
@click.option(
    "--timeout",
    type=POSITIVE,
    default=300.0,
    show_default=True,
    help="Time limit of a run in s.",
)
@result_options
def rivals(names: tuple[str, ...], timeout: float, terminal: Terminal) -> None:
    """Run the same scenes with dry friction in other engines, and measure error, creep, events, run time and lines of
    code.

    RIVAL is one of scipy, pathsim, drake-events, drake-discrete, drake-continuous, mujoco, exudyn, dart and pybullet.
    Default: all.  Each runs with its default and with its best setting, in a separate process.  Rivals that are
    not installed are listed and skipped (pip install 'friction-fmus[rivals]').

    \b
    Examples:
      python -m benchmarks rivals
      python -m benchmarks rivals scipy mujoco
    """
    from . import study
    from .catalogue import find_rivals
    from .comparison import rivals_table, summary_lines

    with terminal.progress(len(find_rivals(names)) + 1) as report:
        comparison = study.run_rivals(names, timeout, terminal.out, report)
    terminal.print_result(
        comparison, rivals_table(comparison), "", *summary_lines(comparison), folder=terminal.out / study.FOLDER
    )
