"""run: one scene, or one FMU of any origin."""

import shlex
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from .terminal import Terminal, result_options, run_options


@click.command()
@click.argument("scene", required=False)
@click.option("--fmu", type=click.Path(path_type=Path), help="Run this FMU, of any origin, instead of a scene.")
@click.option("--set", "values", multiple=True, metavar="NAME=VALUE", help="With --fmu: a value to set.")
@run_options
@result_options
@click.pass_context
def run(
    context: click.Context,
    scene: str | None,
    fmu: Path | None,
    values: tuple[str, ...],
    terminal: Terminal,
    **how: Any,
) -> None:
    """Run a SCENE, an FMU of any origin, or once more what made a folder of results.

    SCENE is a shipped name (see list), the path of a TOML file, a folder of results, or a model that has no scene, by
    its name or the path of its file; or an FMU, as with --fmu.

    An FMU that does not show its solver's steps is run with ever shorter communication steps, until halving them
    changes no output by more than the tolerance.

    \b
    Examples:
      python -m harness run pendulum
      python -m harness run ./my-scene.toml --out elsewhere
      python -m harness run results/pendulum
      python -m harness run --fmu theirs.fmu --set mass=2 --stop 10 --tolerance 1e-4
    """
    from ..scenes.fmu_files import find_fmu, list_models
    from ..scenes.scene import load_scene, scene_from_provenance, shipped_scenes

    scenes = [file.stem for file in shipped_scenes()]
    if (
        fmu is None
        and scene
        and (scene.endswith(".py") or (scene in list_models() - {*scenes} and not Path(scene).exists()))
    ):
        fmu, scene = find_fmu(scene), None
    if fmu is None and scene and scene.endswith(".fmu"):
        fmu, scene = Path(scene), None
    if fmu is not None and scene is None:
        run_fmu_file(fmu, values, how, terminal)
        return
    if scene is None or fmu is not None or values or how["stop"] is not None:
        raise click.UsageError("name one SCENE, or --fmu PATH; --set and --stop go with --fmu")
    from ..results.provenance import load_verified_provenance
    from ..studies.run import study
    from ..studies.run.table import results_table

    place = Path(scene)
    if place.is_dir() and scene not in scenes:
        told = load_verified_provenance(place)
        if not (place / study.FILES[0]).is_file() or "title" not in (told["scene"] or {}):
            rerun_command(context, told["command"])
            return
        chosen = scene_from_provenance(told["scene"])
        if context.get_parameter_source("out") is not ParameterSource.COMMANDLINE:
            terminal = replace(terminal, out=place.parent)
    else:
        chosen = load_scene(scene)
    with terminal.progress(1) as report:
        outcome = study.run_scene(chosen, terminal.out, partial(report, chosen.name))
    table = results_table([outcome], everything=True)
    folder, said = terminal.out / chosen.name, [outcome.run.note] if outcome.run and outcome.run.note else []
    failed = failure_message(outcome.error, folder)
    terminal.print_result(outcome_as_json(outcome, terminal.out), table, *said, folder=folder, failed=failed)


def rerun_command(context: click.Context, command: str) -> None:
    """Run a command again that made a result."""
    root, sys.argv[1:] = context.find_root(), shlex.split(command)[3:]  # which the new result tells as its command
    with root.command.make_context(root.info_name, sys.argv[1:]) as fresh:
        root.command.invoke(fresh)


def run_fmu_file(path: Path, values: tuple[str, ...], how: dict[str, Any], terminal: Terminal) -> None:
    """What `run --fmu` does."""
    from ..results.files import column_heading
    from ..running.run_spec import DEFAULT_EQUAL_STEPS, RunSpec
    from ..scenes.assignments import parse_assignment
    from ..studies.run.study import run_fmu

    with terminal.progress(1) as report:
        wanted = RunSpec(path, values=dict(map(parse_assignment, values)), equal_steps=DEFAULT_EQUAL_STEPS, **how)
        found, folder = run_fmu(wanted, terminal.out, partial(report, path.stem))
    ends = {name: column[[0, -1]].tolist() for name, column in found.columns.items()}
    final = {name: last for name, (_, last) in ends.items()}
    told = {"fmu": found.name, "note": found.note, "failed": found.failure, "final": final, "folder": folder}
    said = [
        f"{column_heading(name, found.units[name])}: from {format_value(first)} to {format_value(last)}"
        for name, (first, last) in ends.items()
    ]
    failed = failure_message(found.failure, folder)
    terminal.print_result(told, *said, *filter(None, [found.note]), folder=folder, failed=failed)


def failure_message(why: str | None, folder: Path) -> list[str]:
    """The sentence about a run that has failed, if it has."""
    return [f"{why}; what it computed until then is in {folder}"] if why else []


def format_value(value: float | str) -> str:
    """A value as people read it."""
    return value if isinstance(value, str) else f"{value:.6g}"


def outcome_as_json(outcome: Any, out: Path) -> dict[str, object]:
    """What a scene gave, for JSON."""
    from ..results.provenance import replacement_note

    told = {"scene": outcome.name, "quantities": outcome.quantities, "error": outcome.error}
    return told | {"said": [*filter(None, [replacement_note(out / outcome.name)])]}
