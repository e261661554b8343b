"""precision: error against run time."""

import click

from .terminal import SectionedCommand, Terminal, result_options


@click.command(cls=SectionedCommand)
@click.argument("models", metavar="[MODEL]...", nargs=-1)
@result_options
@click.option("--quick", is_flag=True, help="Three tolerances and short time limits.")
def precision(models: tuple[str, ...], terminal: Terminal, quick: bool) -> None:
    """Measure error against run time and right-hand side evaluations for each MODEL.  Default: all shipped models.

    MODEL is a name or the path of a file: belt.py with belt.fmu in the same folder, or belt.fmu.  A shipped model is
    compared with an independent reference.  Any other model is compared with its certified result (belt.csv, see
    references), or with the solution on which two of its own methods agree.

    \b
    Examples:
      friction-fmus precision
      friction-fmus precision pacejka --quick
      friction-fmus precision path/to/belt.py
    """
    from ..references.models import MODELS
    from ..studies.precision import table as tables
    from ..studies.precision.study import FULL, QUICK
    from ..studies.precision.survey import STUDY, run_survey

    with terminal.progress(len(models or MODELS)) as report:
        result = run_survey(models or MODELS, QUICK if quick else FULL, terminal.out, report)
    data = {
        "points": {study.model: study.points for study in result.studies},
        "laws": result.deviations,
        "advice": result.advice,
        "missing": result.missing,
    }
    errors = (
        tables.exchange_table(result.studies),
        tables.deviation_table(result.deviations),
    )
    output = [
        block
        for table in (*map(tables.work_precision_table, result.studies), *errors)
        if table.rows
        for block in (table, "")
    ]
    terminal.print_result(data, *output, *result.advice, *result.missing, folder=terminal.out / STUDY.name)
