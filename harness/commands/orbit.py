"""orbit: periodic motions and their stability."""

from functools import partial

import click

from ..errors import MAX_VALUE_LENGTH, SceneError
from .terminal import PERIOD_OPTION, SECTION_OPTION, SET_OPTION, SectionedCommand, Terminal, result_options


@click.command(cls=SectionedCommand)
@click.argument("source", metavar="MODEL|SCENE|FMU")
@SET_OPTION
@click.option("--over", metavar="NAME=LO:HI[:N]", help="Parameter that varies, with its ends and 61 or N values.")
@SECTION_OPTION
@PERIOD_OPTION
@result_options
def orbit(
    source: str,
    values: tuple[str, ...],
    over: str | None,
    section: str | None,
    period: float | None,
    terminal: Terminal,
) -> None:
    """Print the steady sliding and the periodic motions of a model, and over a parameter the points where they change.

    Stable and unstable motions are found, with their Floquet multipliers.  Over a parameter, the points are located at
    which sticking begins or ends, motions meet, or their stability changes.  Of a model, its native FMU is run.

    \b
    Examples:
      friction-fmus orbit belt --set c=0.1,v_belt=2
      friction-fmus orbit belt --set c=0.1 --over v_belt=0.05:3.4
      friction-fmus orbit forced --over Omega=3:15
    """
    from ..api import orbit as find_orbits
    from ..results.provenance import describe_sources
    from ..results.result import save_result
    from ..scenes.assignments import parse_assignments
    from ..simulation.resolve import resolve

    settings, axis = parse_assignments("--set", values), None if over is None else dict([split_axis(over)])
    with terminal.progress(1) as report:
        compute = partial(find_orbits, source, settings, over=axis, section=section, period=period)
        compute = partial(compute, progress=partial(report, source))
        folder = terminal.out / "orbit" / "-".join([resolve(source).model, *(axis or {})])
        result = save_result(folder, compute, "orbit", describe_sources(source))
    terminal.print_result(result.as_json(), *result.blocks(), folder=folder)


def split_axis(text: str) -> tuple[str, list[float]]:
    """Return the name and the ends, or all values, of an argument of --over."""
    name, _, span = text.partition("=")
    low, _, remainder = span.partition(":")
    high, _, count = remainder.partition(":")
    try:
        ends = float(low), float(high)
        steps = int(count) - 1 if count else 1
        if not (name.strip() and ends[0] < ends[1] and steps >= 1 + bool(count)):  # two values are ends
            raise ValueError
    except ValueError:
        hint = "write it as in v_belt=0.1:3 or, for 3 values or more, v_belt=0.1:3:60"
        raise SceneError(f"--over {text[:MAX_VALUE_LENGTH]} is invalid; {hint}") from None
    return name.strip(), [ends[0] + (ends[1] - ends[0]) * i / steps for i in range(steps)] + [ends[1]]
