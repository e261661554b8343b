"""sweep: parameter sweeps."""

from functools import partial
from typing import Any

import click

from ..arguments import NATURAL, RUNS
from ..errors import MAX_VALUE_LENGTH, SceneError
from .terminal import (
    SET_OPTION,
    WORKERS_OPTION,
    RuleType,
    SectionedCommand,
    Terminal,
    refuse_ignored_options,
    refuse_options,
    result_options,
    run_options,
)


@click.command(cls=SectionedCommand)
@click.argument("model")
@click.option(
    "--vary",
    multiple=True,
    required=True,
    metavar="NAME=LO:HI:N",
    help="Parameter to vary; append :log for logarithmic spacing, or list values or labels: a,b,c.",
)
@SET_OPTION
@click.option(
    "--samples",
    type=RuleType(RUNS),
    help="Number of points of a Latin hypercube; requires --vary NAME=LO:HI.",
)
@click.option("--seed", type=RuleType(NATURAL), default=1, show_default=True, help="Seed of the Latin hypercube.")
@click.option(
    "--measures",
    help="Measures, separated by commas. Default: final, and events if the FMU counts them.",
)
@WORKERS_OPTION
@click.option("--name", help="Name of the result folder.")
@run_options
@result_options
@click.pass_context
def sweep(
    context: click.Context,
    model: str,
    vary: tuple[str, ...],
    values: tuple[str, ...],
    samples: int | None,
    seed: int,
    measures: str | None,
    workers: int,
    name: str | None,
    run: dict[str, Any],
    terminal: Terminal,
) -> None:
    """Run MODEL, a name or the path of an FMU, over ranges of parameters and measure every run.

    Measures for every FMU: final, smallest, largest, run_time.  For FMUs of this project also events, steps,
    evaluations and peak_speed, and depending on the model slips, period, unsteady, stuck, rest, zeta and f_over_k.
    Exit status 1 if a run fails.  To resume an interrupted sweep, repeat the command.

    \b
    Examples:
      friction-fmus sweep stickslip --vary mu_d=0.3:0.9:60 --vary v_driver=0.01:0.5:60 --measures slips,period
      friction-fmus sweep pacejka --vary x_m=0.001:0.1:40:log --measures unsteady,steps
      friction-fmus sweep other.fmu --vary mu=0,0.1,0.2 --measures final,largest
      friction-fmus sweep coulomb --vary f=0.1:2 --vary k=50:500 --samples 1000
    """
    if samples is None:
        refuse_options(context, "without --samples", "seed")
    from ..api import sweep as sweep_model
    from ..scenes.assignments import parse_assignments
    from ..scenes.fmu_files import find_fmu

    refuse_ignored_options(context, [find_fmu(model)], timeout_is_ignored=True)
    measure_names = [word.strip() for word in measures.split(",")] if measures is not None else ()
    grid = dict(map(split_range, vary))
    if len(grid) < len(vary):
        raise SceneError("--vary names a parameter twice")
    with terminal.progress(1) as report:
        result = sweep_model(
            model,
            grid,
            values=parse_assignments("--set", values),
            samples=samples,
            seed=seed,
            measures=measure_names,
            workers=workers,
            folder=terminal.out,
            name=name,
            progress=partial(report, model),
            **run,
        )
    failures = [*result.describe_failures()]
    terminal.print_result(result.as_json(), *result.blocks(), folder=result.folder, failures=failures)


def split_range(text: str) -> tuple[str, str]:
    """Return the name and the values of an argument of --vary."""
    name, equals, values = text.partition("=")
    if not (name.strip() and equals):
        raise SceneError(f"--vary {text[:MAX_VALUE_LENGTH]} is invalid; write it as in m=1:2:11 or m=1,2")
    return name.strip(), values.strip()
