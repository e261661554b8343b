"""map: regions of what motions end in."""

from functools import partial

import click

from ..errors import MAX_VALUE_LENGTH, SceneError
from .orbit import split_axis
from .terminal import (
    PERIOD_OPTION,
    SECTION_OPTION,
    SET_OPTION,
    WORKERS_OPTION,
    SectionedCommand,
    Terminal,
    result_options,
)


@click.command("map", cls=SectionedCommand)
@click.argument("source", metavar="MODEL|SCENE|FMU")
@click.option(
    "--over",
    multiple=True,
    required=True,
    metavar="NAME=LO:HI[:N]",
    help="Parameter that varies, with its ends and 21 or N values. Once or twice.",
)
@SET_OPTION
@SECTION_OPTION
@PERIOD_OPTION
@click.option("--measure", help="Measure of `sweep` whose whole numbers are the regions, as slips or events.")
@click.option("--levels", help="Values between the regions of the measure, separated by commas.")
@WORKERS_OPTION
@result_options
def map_motions(
    source: str,
    over: tuple[str, ...],
    values: tuple[str, ...],
    section: str | None,
    period: float | None,
    measure: str | None,
    levels: str | None,
    workers: int,
    terminal: Terminal,
) -> None:
    """Print what the motions of a model end in over one or two parameters, with exact edges between the regions.

    Of one body that slides steadily, the regions say whether steady sliding is stable and whether stick-slip goes on;
    of any other model, what motions from its start and from those beside it end in.  Of a model, its native FMU is
    run; any other FMU needs a section or a measure.  Exit status 1 if a run fails.

    \b
    Examples:
      friction-fmus map belt --over v_belt=0.3:8 --over c=0.03:0.6
      friction-fmus map forced --over Omega=2:15:40
      friction-fmus map stickslip --over mu_d=0.3:0.8 --measure slips
    """
    from ..api import map_motions as compute_map
    from ..results.provenance import describe_sources
    from ..results.result import save_result
    from ..scenes.assignments import parse_assignments
    from ..simulation.resolve import resolve

    axes = dict(map(split_axis, over))
    if len(axes) < len(over):
        raise SceneError("--over names a parameter twice")
    settings = parse_assignments("--set", values)
    with terminal.progress(1) as report:
        compute = partial(compute_map, source, axes, settings, workers=workers)
        compute = partial(compute, section=section, period=period, measure=measure, progress=partial(report, source))
        compute = partial(compute, levels=None if levels is None else split_numbers(levels))
        folder = terminal.out / "map" / "-".join([resolve(source).model, *axes])
        result = save_result(folder, compute, "map", describe_sources(source))
    failures = [f"{len(result.failures)} of {result.n_runs} runs failed"] * bool(result.failures)
    terminal.print_result(result.as_json(), *result.blocks(), folder=folder, failures=failures)


def split_numbers(text: str) -> list[float]:
    """Return the numbers of an argument of --levels."""
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise SceneError(f"--levels {text[:MAX_VALUE_LENGTH]} is invalid; write numbers as in 0.1,0.2") from None
