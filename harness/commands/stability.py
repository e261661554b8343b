"""stability: stiff and extreme cases."""

from functools import partial

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
    from ..results.provenance import describe_sources, prefix_parameters
    from ..results.result import save_result
    from ..scenes.fmu_files import find_fmu
    from ..simulation.fmu_archive import declared_parameters
    from ..studies.stability.study import grouped_cases, measure_stability

    groups, folder = grouped_cases(models=models), terminal.out / "stability"
    fmus = {case.name: find_fmu(case.model) for group in groups for case in group}
    parameters = prefix_parameters({name: declared_parameters(fmu) for name, fmu in fmus.items()})
    with terminal.progress(sum(map(len, groups))) as report:
        compute, source = partial(measure_stability, groups, report), describe_sources(*models)
        result = save_result(folder, compute, "stability", source, files=fmus.values(), parameters=parameters)
    terminal.print_result(result.as_json(), *result.blocks(), folder=folder, failures=result.describe_failures())
