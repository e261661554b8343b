"""precision: error against run time."""

from functools import partial

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
    from ..results.result import save_result
    from ..scenes.fmu_files import find_fmu
    from ..simulation.embedded_model import load_model_class
    from ..simulation.fmu_archive import declared_parameters
    from ..studies.precision.study import FULL, QUICK, measure_precision

    out, settings, results = terminal.out / "precision", QUICK if quick else FULL, []
    files = {model: find_fmu(model) for model in models or MODELS}
    for file in files.values():
        load_model_class(file)  # before the first measurement
    with terminal.progress(len(files)) as report:
        for model, file in files.items():
            compute = partial(measure_precision, model, settings, partial(report, model))
            origin = {"files": [file], "parameters": declared_parameters(file)}
            results.append(save_result(out / file.stem, compute, "precision", "", **origin))
    data = {
        "points": {result.model: result.points for result in results},
        "laws": [law for result in results for law in result.deviations],
        "advice": [result.advice for result in results],
        "missing": [*dict.fromkeys(note for result in results for note in result.notes)],
    }
    terminal.print_result(data, *(block for result in results for block in result.blocks()), folder=out)
