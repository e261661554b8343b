"""stability: stiff and extreme scenes."""

import click

from .terminal import Terminal, results


@click.command()
@click.argument("models", metavar="[MODEL]...", nargs=-1)
@results
def stability(models: tuple[str, ...], terminal: Terminal) -> None:
    """Run stiff and extreme scenes with every method: each ends right, or is refused with a sentence.

    They are those of each MODEL (without one: all there are).  A MODEL is a name, or the path of a file (belt.py, whose
    FMU lies beside it, or belt.fmu): then its numbers are varied, and what two of its methods agree about is right.
    Exit status 1 if one ends otherwise.

    \b
    Examples:
      python -m harness stability
      python -m harness stability stickslip path/to/belt.py
    """
    from ..results.provenance import describe_sources
    from ..studies.stability import table as tables
    from ..studies.stability.study import FOLDER, all_cases, survey

    chosen = all_cases(models=models)
    with terminal.progress(sum(map(len, chosen))) as report:
        rows, regions = survey(terminal.out, report, chosen, describe_sources(*models))
    told = [{"scene": row.case.label, "well": row.well, "ended": row.ended} for row in rows]
    shown = (tables.endings(rows), "", tables.refusals(rows), "", tables.summary(rows, regions))
    wrong = (f"{row.case.label}: {row.text}" for row in rows if not row.well)
    terminal.answer(told, *shown, folder=terminal.out / FOLDER, failed=wrong)
