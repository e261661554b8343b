"""stability: stiff and extreme scenes."""

import click

from .terminal import Terminal, result_options


@click.command()
@click.argument("models", metavar="[MODEL]...", nargs=-1)
@result_options
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
    from ..studies.stability.study import FOLDER, grouped_cases, run_stability

    chosen = grouped_cases(models=models)
    with terminal.progress(sum(map(len, chosen))) as report:
        rows, regions = run_stability(terminal.out, report, chosen, describe_sources(*models))
    told = [{"scene": row.case.label, "passed": row.passed, "ended": row.ended} for row in rows]
    shown = (tables.error_table(rows), "", tables.refusal_table(rows), "", tables.summary(rows, regions))
    wrong = (f"{row.case.label}: {row.text}" for row in rows if not row.passed)
    terminal.print_result(told, *shown, folder=terminal.out / FOLDER, failed=wrong)
