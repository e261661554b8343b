"""stability: stiff and extreme cases."""

import click

from .terminal import SectionedCommand, Terminal, result_options


@click.command(cls=SectionedCommand)
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
    from ..studies.stability.study import STUDY, grouped_cases, run_stability

    groups = grouped_cases(models=models)
    with terminal.progress(sum(map(len, groups))) as report:
        result = run_stability(terminal.out, report, groups, describe_sources(*models))
    folder = terminal.out / STUDY.name
    terminal.print_result(result.as_json(), *result.blocks(), folder=folder, failed=result.describe_failures())
