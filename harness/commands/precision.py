"""precision: what accuracy costs."""

import click

from .terminal import Terminal, result_options


@click.command()
@click.argument("models", metavar="[MODEL]...", nargs=-1)
@result_options
@click.option("--quick", is_flag=True, help="Three tolerances only, and little patience.")
def precision(models: tuple[str, ...], terminal: Terminal, quick: bool) -> None:
    """Show what accuracy costs: error against run time and right-hand sides, for each MODEL (without one: all of ours).

    A MODEL is a name, or the path of a file (belt.py, whose FMU lies beside it, or belt.fmu).  What somebody else has
    not written a second time is held against its certified result (belt.csv, see references), or against two of its
    own methods, where they agree.

    \b
    Examples:
      python -m harness precision
      python -m harness precision pacejka --quick
      python -m harness precision path/to/belt.py
    """
    from ..references.models import MODELS
    from ..studies.precision import table as tables
    from ..studies.precision.study import FULL, QUICK
    from ..studies.precision.survey import FOLDER, run_survey

    with terminal.progress(len(models or MODELS) + 1) as report:
        found = run_survey(models or MODELS, QUICK if quick else FULL, terminal.out, report)
    told = {
        "points": {study.model: study.points for study in found.studies},
        "laws": found.deviations,
        "anchors": found.literature,
        "advice": found.advice,
        "missing": found.missing,
    }
    errors = (
        tables.exchange_table(found.studies),
        tables.deviation_table(found.deviations),
        tables.literature_table(found.literature),
    )
    shown = [
        each
        for table in (*map(tables.work_precision_table, found.studies), *errors)
        if table.rows
        for each in (table, "")
    ]
    terminal.print_result(told, *shown, *found.advice, *found.missing, folder=terminal.out / FOLDER)
