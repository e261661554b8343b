"""run: one scene or one FMU."""

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from ..errors import HarnessError
from .terminal import Terminal, build_arguments, refuse_ignored_options, result_options, run_options

UNUSED_SWEEP_OPTIONS = ("name", "scheduler")  # of a recorded call


@click.command()
@click.argument("scene", required=False)
@click.option("--fmu", type=click.Path(path_type=Path), help="Run this FMU instead of a scene.")
@click.option(
    "--set", "values", multiple=True, metavar="NAME=VALUE,...", help="Start values; only with an FMU. Repeatable."
)
@run_options
@result_options
@click.pass_context
def run(
    context: click.Context,
    scene: str | None,
    fmu: Path | None,
    values: tuple[str, ...],
    terminal: Terminal,
    **options: Any,
) -> None:
    """Run a SCENE or an FMU, or re-run a stored result, bit for bit.

    SCENE is the name of a shipped scene (see list), the path of a TOML file, a result folder, the path of an FMU, or
    the name or path of a model without a scene.

    An FMU that does not expose its solver steps is run with successively halved communication steps, until halving
    changes no output by more than the tolerance, or cannot reach it. The achieved error is stated. A run that misses
    the tolerance fails only if --rtol is given.

    \b
    Examples:
      friction-fmus run pendulum
      friction-fmus run ./my-scene.toml --out elsewhere
      friction-fmus run results/pendulum
      friction-fmus run --fmu other.fmu --set mass=2 --stop 10 --rtol 1e-4
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
    refuse_ignored_options(context, [fmu] if fmu else [])
    if fmu is not None and scene is None:
        run_fmu_file(fmu, values, options, terminal)
        return
    if scene is None or fmu is not None or values or options["stop"] is not None:
        raise click.UsageError("give one SCENE, or --fmu PATH; --set and --stop require an FMU")
    from ..results.folder import REPEATED
    from ..results.provenance import PYTHON_API, load_verified_provenance
    from ..studies.run import study
    from ..studies.run.table import results_table

    folder_path = Path(scene)
    if folder_path.is_dir() and scene not in scenes:
        provenance = load_verified_provenance(folder_path)
        if not (folder_path / study.STUDY.files[0]).is_file() or "title" not in (provenance["scene"] or {}):
            if provenance["command"] == PYTHON_API:
                raise HarnessError(f"{scene} was written from Python: repeat its run by harness.simulate('{scene}')")
            repeat_call(context, folder_path, provenance, terminal)
            return
        selected_scene = scene_from_provenance(provenance)
        if context.get_parameter_source("out") is not ParameterSource.COMMANDLINE:
            if folder_path.name in ("", ".."):
                folder_path = folder_path.resolve()
            selected_scene = replace(selected_scene, name=folder_path.name)
            terminal = replace(terminal, out=folder_path.parent)
            REPEATED.set(folder_path)
    else:
        selected_scene = load_scene(scene)
    with terminal.progress(1) as report:
        outcome = study.run_scene(selected_scene, terminal.out, partial(report, selected_scene.name))
    table = results_table([outcome], everything=True)
    folder = terminal.out / selected_scene.name
    notes = [*study.describe_known_values(selected_scene), *filter(None, [outcome.run.note if outcome.run else ""])]
    failed = failure_message(outcome.error, folder)
    terminal.print_result(outcome_as_json(outcome, terminal.out), table, *notes, folder=folder, failed=failed)


def repeat_call(context: click.Context, folder: Path, provenance: dict[str, Any], terminal: Terminal) -> None:
    """Repeat the recorded call of a command; the recorded command text is only displayed, never run.

    The result is written to the same folder, or below the --out of this command line. A recorded name of the folder or
    address of a cluster is not used: a folder from elsewhere chooses neither where to write nor where to connect.
    """
    from ..results.folder import REPEATED
    from ..results.registry import STUDIES

    root, call = context.find_root(), provenance.get("call")
    depths = {study.command: study.depth for study in STUDIES if study.depth}
    if call is None or call["name"] not in depths:
        raise HarnessError(
            f"{folder} does not hold the run of one scene or FMU; its command was `{provenance['command']}`"
        )
    command = root.command.commands[call["name"]]  # type: ignore[attr-defined]
    folder = folder.resolve() if folder.name in ("", "..") else folder.absolute()
    out = folder.parents[depths[call["name"]] - 1]
    if context.get_parameter_source("out") is ParameterSource.COMMANDLINE:
        out = terminal.out
    else:
        REPEATED.set(folder)
    output = [f"--out={out}", *["--quiet"] * terminal.quiet, *["--json"] * terminal.as_json]
    options = dict(call["options"])
    if call["name"] == "sweep":
        output.append(f"--name={folder.name}")
        options = {name: value for name, value in options.items() if name not in UNUSED_SWEEP_OPTIONS}
    arguments = [*output, *build_arguments(command, options)]
    sys.argv[1:] = [call["name"], *arguments]  # recorded as the command
    with command.make_context(call["name"], arguments, parent=root) as new_context:
        command.invoke(new_context)


def run_fmu_file(path: Path, values: tuple[str, ...], options: dict[str, Any], terminal: Terminal) -> None:
    """Run one FMU and print the first, last, smallest and largest value of each output."""
    from ..running.resolve import set_rtol
    from ..scenes.assignments import parse_assignments
    from ..scenes.run_spec import DEFAULT_EQUAL_STEPS, RunSpec
    from ..studies.run.study import run_fmu

    rtol = options.pop("tolerance")
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
