"""run: one scene or one FMU."""

from functools import partial
from pathlib import Path
from typing import Any

import click

from .terminal import SectionedCommand, Terminal, refuse_ignored_options, result_options, run_options


@click.command(cls=SectionedCommand)
@click.argument("source", metavar="MODEL|SCENE|FMU")
@click.option(
    *("--set", "values"),
    multiple=True,
    metavar="NAME=VALUE,...",
    help="Parameters and start values; those of a scene are replaced. Repeatable.",
)
@run_options
@result_options
@click.pass_context
def run(
    context: click.Context,
    source: str,
    values: tuple[str, ...],
    terminal: Terminal,
    **options: Any,
) -> None:
    """Run a model, a scene or an FMU.

    The argument is the name of a scene or a model (see info), the path of a scene file or a model file, or the path of
    an FMU.  A name that a scene and a model share means the scene.  A scene with other values by --set, or another
    --stop, is not compared with its published or reference values.

    An FMU that does not expose its solver steps is run with successively halved communication steps, until halving
    changes no output by more than the tolerance, or cannot reach it. The achieved error is stated. A run that misses
    the tolerance fails only if --rtol is given.

    \b
    Examples:
      friction-fmus run pendulum
      friction-fmus run stickslip --set mu_s=0.7,mu_d=0.5
      friction-fmus run ./my-scene.toml --out elsewhere
      friction-fmus run other.fmu --set mass=2 --stop 10 --rtol 1e-4
    """
    from ..scenes.assignments import parse_assignments
    from ..scenes.scene import change_scene
    from ..simulation.resolve import find_source
    from ..studies.run import study
    from ..studies.run.table import results_table

    item = find_source(source, scenes_first=True)
    refuse_ignored_options(context, [item] if isinstance(item, Path) else [])
    if isinstance(item, Path):
        run_fmu_file(item, values, options, terminal)
        return
    item = change_scene(item, parse_assignments("--set", values), options["stop"])
    with terminal.progress(1) as report:
        outcome = study.run_scene(item, terminal.out, partial(report, item.name))
    table = results_table([outcome], everything=True)
    folder = terminal.out / item.name
    notes = [*study.describe_known_values(item), *filter(None, [outcome.run.note if outcome.run else ""])]
    failed = failure_message(outcome.error, folder)
    terminal.print_result(outcome_as_json(outcome, terminal.out), table, *notes, folder=folder, failed=failed)


def run_fmu_file(path: Path, values: tuple[str, ...], options: dict[str, Any], terminal: Terminal) -> None:
    """Run one FMU and print the first, last, smallest and largest value of each output."""
    from ..scenes.assignments import parse_assignments
    from ..scenes.run_spec import DEFAULT_EQUAL_STEPS, RunSpec
    from ..simulation.resolve import set_rtol
    from ..studies.run.study import run_fmu

    rtol = options.pop("rtol")
    with terminal.progress(1) as report:
        spec = RunSpec(path, values=parse_assignments("--set", values), equal_steps=DEFAULT_EQUAL_STEPS, **options)
        if rtol is not None:
            spec = set_rtol(spec, rtol)
        trajectory, folder = run_fmu(spec, terminal.out, partial(report, path.stem))
    failed = failure_message(trajectory.failure, folder)
    terminal.print_result(trajectory.as_json() | {"folder": folder}, *trajectory.blocks(), folder=folder, failed=failed)


def failure_message(message: str | None, folder: Path) -> list[str]:
    """Return the error message of an incomplete run in a list, which is empty if the run finished."""
    return [f"{message}; the results up to that time are in {folder}"] if message else []


def outcome_as_json(outcome: Any, out: Path) -> dict[str, object]:
    """Return the results of a scene for JSON output."""
    from ..results.provenance import replacement_note
    from ..studies.run.table import comparison_as_json

    data = {"scene": outcome.name, "quantities": outcome.quantities, "error": outcome.error}
    data["comparison"] = comparison_as_json(outcome)
    return data | {"said": [*filter(None, [replacement_note(out / outcome.name)])]}
