"""sensitivity: derivatives of a motion by parameters."""

from functools import partial
from typing import Any

import click

from .terminal import POSITIVE, SET_OPTION, STOP_OPTION, SectionedCommand, Terminal, is_given, result_options


def split_names(context: click.Context, option: click.Parameter, text: str | None) -> list[str] | None:
    """Return the names in a text."""
    return None if text is None else [name.strip() for name in text.split(",")]


@click.command(cls=SectionedCommand)
@click.argument("source", metavar="MODEL|SCENE|FMU")
@click.option(
    *("--by", "parameters"),
    required=True,
    metavar="NAME,...",
    callback=split_names,
    help="Parameters, start values, inputs.",
)
@SET_OPTION
@click.option("--outputs", metavar="NAME,...", callback=split_names, help="Outputs; by default all Reals.")
@STOP_OPTION
@click.option("--rtol", type=POSITIVE, help="Relative tolerance of the integration.  [default: 1e-11]")
@result_options
@click.pass_context
def sensitivity(
    context: click.Context,
    source: str,
    parameters: list[str],
    values: tuple[str, ...],
    terminal: Terminal,
    **options: Any,
) -> None:
    """Print the derivatives of the outputs by parameters, through stick, slip and other events.

    The FMU needs model exchange with directional derivatives, as native FMUs of this project have; of a model, its
    native FMU is run.  The results are the outputs and their derivatives over time, and the times of the events with
    their derivatives.  Where no derivative exists, the command says from which time on.

    \b
    Examples:
      friction-fmus sensitivity stickslip --by mu_s,k
      friction-fmus sensitivity pendulum --by mu,theta0 --outputs theta --stop 3
    """
    from ..api import sensitivity as compute_sensitivity
    from ..results.provenance import describe_sources
    from ..results.result import save_result
    from ..scenes.assignments import parse_assignments
    from ..simulation.resolve import resolve

    explicit_options = {name: value for name, value in options.items() if is_given(context, name)}
    settings = parse_assignments("--set", values)
    with terminal.progress(1) as report:
        progress = partial(report, source)
        compute = partial(compute_sensitivity, source, parameters, settings, **explicit_options, progress=progress)
        folder = terminal.out / "sensitivity" / resolve(source).model
        result = save_result(folder, compute, "sensitivity", describe_sources(source))
    terminal.print_result(result.as_json(), *result.blocks(), folder=folder)
