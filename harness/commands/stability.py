"""stability: stiff and extreme cases."""

import click

from .terminal import Terminal, result_options


@click.command()
@click.argument("models", metavar="[MODEL]...", nargs=-1)
@result_options
def stability(models: tuple[str, ...], terminal: Terminal) -> None:
    """Run stiff and extreme cases with every method.  Each case must finish within its error bound, or be rejected with
    an error message.

    MODEL is a name or the path of a file: belt.py with belt.fmu in the same folder, or belt.fmu.  Default: all shipped
    models. For a file, the parameters are varied, and the reference is the solution on which two of its methods agree.
    Exit status 1 if a case fails.

    \b
    Examples:
      friction-fmus stability
      friction-fmus stability stickslip path/to/belt.py
    """
    from ..results.provenance import describe_sources
    from ..studies.stability import table as tables
    from ..studies.stability.study import FOLDER, grouped_cases, run_stability

    groups = grouped_cases(models=models)
    with terminal.progress(sum(map(len, groups))) as report:
        rows, regions = run_stability(terminal.out, report, groups, describe_sources(*models))
    results = [{"scene": row.case.label, "passed": row.has_passed, "ended": row.ended} for row in rows]
    output = (tables.error_table(rows), "", tables.refusal_table(rows), "", tables.summary(rows, regions))
    failures = (f"{row.case.label}: {row.text}" for row in rows if not row.has_passed)
    terminal.print_result(results, *output, folder=terminal.out / FOLDER, failed=failures)
