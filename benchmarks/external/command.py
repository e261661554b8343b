"""external: run FMUs of other tools through the commands run, compare, sweep and fit."""

from pathlib import Path

import click

from harness.commands.terminal import Terminal, result_options


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--timeout", type=float, default=300.0, show_default=True, help="Seconds allowed for one command.")
@result_options
def external(folder: Path, timeout: float, terminal: Terminal) -> None:
    """Run each FMU of FOLDER through run, compare, sweep and fit, and print a table of the outcomes.

    The results are checked by fmpy's own loop: run and compare against its values at the same steps, the values of
    sweep, and the parameter that fit finds in a record that fmpy simulated with another value. If an FMU offers both
    interfaces, its co-simulation is compared with model exchange. The commands run in a terminal of their own, and
    the table shows after how many seconds the first progress appears. Exit status 1 if a result is wrong.

    \b
    Examples:
      python -m benchmarks external ~/fmus
    """
    from .trials import FAULT, make_table, run_trials

    fmus = sorted(folder.glob("*.fmu"))
    if not fmus:
        raise click.UsageError(f"{folder} contains no *.fmu")
    with terminal.progress(len(fmus)) as report:
        trials = run_trials(fmus, terminal.out, timeout, report)
    faults = [f"{trial.fmu} {trial.command}: {trial.text}" for trial in trials if trial.outcome == FAULT]
    terminal.print_result(trials, make_table(trials), folder=terminal.out, failures=faults)
