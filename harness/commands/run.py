"""run: one scene, or one FMU of any origin."""

import shlex
import sys
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from ..errors import HarnessError
from .terminal import answer, anyones, progress, results


@click.command()
@click.argument("scene", required=False)
@click.option("--fmu", type=click.Path(path_type=Path), help="Run this FMU, of any origin, instead of a scene.")
@click.option("--set", "values", multiple=True, metavar="NAME=VALUE", help="With --fmu: a value to set.")
@anyones
@results
@click.pass_context
def run(
    context: click.Context,
    scene: str | None,
    fmu: Path | None,
    values: tuple[str, ...],
    out: Path,
    quiet: bool,
    as_json: bool,
    **how: Any,
) -> None:
    """Run a SCENE, an FMU of any origin, or once more what made a folder of results.

    SCENE is a shipped name (see list), the path of a TOML file, a folder of results, or a model that has no scene.

    An FMU that does not show its solver's steps is run with ever shorter communication steps, until halving them
    changes no output by more than the tolerance.

    \b
    Examples:
      python -m harness run pendulum
      python -m harness run ./my-scene.toml --out elsewhere
      python -m harness run results/pendulum
      python -m harness run --fmu theirs.fmu --set mass=2 --stop 10 --tolerance 1e-4
    """
    from ..scenes.fmus import fmu_of, known
    from ..scenes.scene import again, load, shipped

    scenes = [file.stem for file in shipped()]
    if fmu is None and scene in known() - {*scenes} and not Path(scene).exists():
        fmu, scene = fmu_of(scene), None
    if fmu is not None and scene is None:
        run_any(fmu, values, how, out, quiet, as_json)
        return
    if scene and scene.endswith(".fmu"):
        raise click.UsageError(f"an FMU is run by --fmu {scene}")
    if scene is None or fmu is not None or values or how["stop"] is not None:
        raise click.UsageError("name one SCENE, or --fmu PATH; --set and --stop go with --fmu")
    from ..results.provenance import trusted
    from ..studies.run import job
    from ..studies.run.table import comparison

    place = Path(scene)
    if place.is_dir() and scene not in scenes:
        told = trusted(place)
        if not (place / job.FILES[0]).is_file() or "title" not in (told["scene"] or {}):
            repeat(context, told["command"])
            return
        chosen = again(told["scene"])
        out = out if context.get_parameter_source("out") is ParameterSource.COMMANDLINE else place.parent
    else:
        chosen = load(scene)
    with progress(quiet or as_json, 1) as report:
        outcome = job.perform(chosen, out, partial(report, chosen.name))
    table = comparison([outcome], everything=True)
    folder, said = out / chosen.name, [outcome.run.note] if outcome.run and outcome.run.note else []
    answer(quiet, as_json, figures(outcome, out), table, *said, folder=folder)
    if outcome.error:
        raise HarnessError(f"{outcome.error}; what it computed until then is in {folder}")


def repeat(context: click.Context, command: str) -> None:
    """Run a command again that made a result."""
    root, sys.argv[1:] = context.find_root(), shlex.split(command)[3:]  # which the new result tells as its command
    with root.command.make_context(root.info_name, sys.argv[1:]) as fresh:
        root.command.invoke(fresh)


def run_any(path: Path, values: tuple[str, ...], how: dict[str, Any], out: Path, quiet: bool, as_json: bool) -> None:
    """What `run --fmu` does."""
    from ..results.files import heading
    from ..running.specification import EVEN, Specification
    from ..scenes.assigned import assigned
    from ..studies.run.any_fmu import perform_run

    with progress(quiet or as_json, 1) as report:
        wanted = Specification(path, values=dict(map(assigned, values)), even=EVEN, **how)
        found, folder = perform_run(wanted, out, partial(report, path.stem))
    ends = {name: column[[0, -1]].tolist() for name, column in found.columns.items()}
    final = {name: last for name, (_, last) in ends.items()}
    told = {"fmu": found.name, "note": found.note, "failed": found.failed, "final": final, "folder": folder}
    said = [
        f"{heading(name, found.units[name])}: from {shown(first)} to {shown(last)}"
        for name, (first, last) in ends.items()
    ]
    answer(quiet, as_json, told, *said, *filter(None, [found.note]), folder=folder)
    if found.failed:
        raise HarnessError(f"{found.failed}; what it computed until then is in {folder}")


def shown(value: float | str) -> str:
    """A value as people read it."""
    return value if isinstance(value, str) else f"{value:.6g}"


def figures(outcome: Any, out: Path) -> dict[str, object]:
    """What a scene gave, for JSON."""
    from ..results.provenance import replaced

    told = {"scene": outcome.name, "quantities": outcome.quantities, "error": outcome.error}
    return told | {"said": [*filter(None, [replaced(out / outcome.name)])]}
