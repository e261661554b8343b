"""precision: what accuracy costs."""

from pathlib import Path

import click

from .terminal import JSON, OUT, QUIET, progress, screen, tell


@click.command()
@click.argument("models", metavar="[MODEL]...", nargs=-1)
@OUT
@QUIET
@JSON
@click.option("--quick", is_flag=True, help="Three tolerances only, and little patience.")
def precision(models: tuple[str, ...], out: Path, quiet: bool, as_json: bool, quick: bool) -> None:
    """Show what accuracy costs: error against run time and right-hand sides, for each MODEL (without one: all).

    \b
    Examples:
      python -m harness precision
      python -m harness precision pacejka --quick
    """
    from ..studies.precision import table as tables
    from ..studies.precision.study import FULL, QUICK
    from ..studies.precision.survey import FOLDER, survey
    from ..truths.reference import MODELS

    with progress(quiet or as_json, len(models or MODELS) + 1) as report:
        found = survey(models or MODELS, QUICK if quick else FULL, out, report)
    if as_json:
        points = {study.model: study.points for study in found.studies}
        rest = {"laws": found.laws, "anchors": found.anchors, "advice": found.advice, "missing": found.missing}
        tell({"points": points} | rest)
    elif not quiet:
        errors = (tables.exchange(found.studies), tables.laws(found.laws), tables.anchors(found.anchors))
        for table in (*map(tables.work, found.studies), *errors):
            screen().print(table, "")
        for sentence in (*found.advice, *found.missing):
            screen().print(sentence, highlight=False)
        screen().print(f"Results in {out / FOLDER}", highlight=False)
