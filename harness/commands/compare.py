"""compare: how far two results or FMUs are apart."""

from functools import partial
from pathlib import Path
from typing import Any

import click

from .terminal import FiniteFloat, Terminal, result_options, run_options


@click.command()
@click.argument("one", metavar="A")
@click.argument("two", metavar="B")
@run_options
@click.option(
    "--rtol", "--within", type=FiniteFloat(min=0), help="Share of its largest value by which each may differ."
)
@click.option("--atol", type=FiniteFloat(min=0), help="What each may differ by on top, in its unit.")
@result_options
def compare(one: str, two: str, rtol: float | None, atol: float | None, terminal: Terminal, **how: Any) -> None:
    """Show how far A and B are apart: FMUs of any origin (FMI 2.0, 3.0), scenes, result folders or files, those of
    other tools too (fmpy's CSV; OpenModelica's and Dymola's .csv and .mat; any table whose first column is the time).

    What can be run is run to the times of the other.  Between its samples a variable follows its rate where that was
    recorded, otherwise it stays between its neighbours, and what is whole numbers holds.  Exit status 0: no difference
    is larger than rtol and atol allow together, if either is given, and events match; 1: one is, or a run failed;
    2: wrong usage.

    \b
    Examples:
      python -m harness compare results/stickslip results/stickslip-threshold
      python -m harness compare fmus/coulomb.fmu theirs.fmu --stop 2
      python -m harness compare results/smd measured.csv --rtol 1e-3 --atol 1e-6
    """
    from ..running.run_spec import RunSpec
    from ..studies.compare import study

    with terminal.progress(1) as report:
        asked = RunSpec(Path(), **how)
        found, folder = study.run_comparison((one, two), asked, terminal.out, partial(report, "compare"))
    failed = [each.failure for each in (found.one, found.two) if each.failure]
    if rtol is not None or atol is not None:
        failed += found.violations(rtol or 0.0, atol or 0.0)
    shown = (study.difference_table(found), "", *study.summary_lines(found))
    terminal.print_result(study.comparison_as_json(found), *shown, folder=folder, failed=failed)
