"""run: one scene, or one FMU of any origin."""

from functools import partial
from pathlib import Path
from typing import Any

import click

from ..errors import HarnessError
from .terminal import answer, anyones, progress, results, tell


@click.command()
@click.argument("scene", required=False)
@click.option("--fmu", type=click.Path(path_type=Path), help="Run this FMU, of any origin, instead of a scene.")
@click.option("--set", "values", multiple=True, metavar="NAME=VALUE", help="With --fmu: a value to set.")
@anyones
@results
def run(
    scene: str | None, fmu: Path | None, values: tuple[str, ...], out: Path, quiet: bool, as_json: bool, **how: Any
) -> None:
    """Run one SCENE: a shipped name (see list) or the path of a TOML file.  Or run an FMU of any origin.

    An FMU that does not show its solver's steps is run with ever shorter communication steps, until halving them
    changes no output by more than the tolerance.

    \b
    Examples:
      python -m harness run pendulum
      python -m harness run ./my-scene.toml --out elsewhere
      python -m harness run --fmu theirs.fmu --set mass=2 --stop 10 --tolerance 1e-4
    """
    if fmu is not None and scene is None:
        run_any(fmu, values, how, out, quiet, as_json)
        return
    if scene is None or fmu is not None or values or how["stop"] is not None:
        raise click.UsageError("name one SCENE, or --fmu PATH; --set and --stop go with --fmu")
    from ..scenes.scene import load
    from ..studies.run import job
    from ..studies.run.table import comparison

    chosen = load(scene)
    with progress(quiet or as_json, 1) as report:
        outcome = job.perform(chosen, out, partial(report, chosen.name))
    table = comparison([outcome], everything=True)
    folder, note = out / chosen.name, outcome.run.note if outcome.run else ""
    answer(quiet, as_json, figures(outcome), table, *filter(None, [note]), f"Results in {folder}")
    if outcome.error:
        raise HarnessError(f"{outcome.error}; what it computed until then is in {folder}")


def run_any(path: Path, values: tuple[str, ...], how: dict[str, Any], out: Path, quiet: bool, as_json: bool) -> None:
    """What `run --fmu` does."""
    from ..results.files import heading
    from ..running.specification import EVEN, Specification
    from ..scenes.assigned import assigned
    from ..studies.run.any_fmu import perform_run

    with progress(quiet or as_json, 1) as report:
        wanted = Specification(path, values=dict(map(assigned, values)), even=EVEN, **how)
        found, folder = perform_run(wanted, out, partial(report, path.stem))
    ends = {name: column[-1].item() for name, column in found.columns.items()}
    if as_json:
        tell({"fmu": found.name, "note": found.note, "failed": found.failed, "final": ends, "folder": str(folder)})
    elif not quiet:
        for name, value in ends.items():
            first = found.columns[name][0].item()
            click.echo(f"{heading(name, found.units[name])}: from {shown(first)} to {shown(value)}")
        click.echo(f"{found.note}\nResults in {folder}" if found.note else f"Results in {folder}")
    if found.failed:
        raise HarnessError(f"{found.failed}; what it computed until then is in {folder}")


def shown(value: float | str) -> str:
    """A value as people read it."""
    return value if isinstance(value, str) else f"{value:.6g}"


def figures(outcome: Any) -> dict[str, object]:
    """What a scene gave, for JSON."""
    return {"scene": outcome.name, "quantities": outcome.quantities, "error": outcome.error}
