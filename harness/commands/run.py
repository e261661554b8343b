"""run: one scene, or one FMU of any origin."""

from functools import partial
from pathlib import Path
from typing import Any

import click

from .terminal import STOP, TOLERANCE, answer, progress, results, tell


@click.command()
@click.argument("scene", required=False)
@click.option("--fmu", type=click.Path(path_type=Path), help="Run this FMU, of any origin, instead of a scene.")
@click.option("--set", "values", multiple=True, metavar="NAME=VALUE", help="With --fmu: a value to set.")
@STOP
@TOLERANCE
@results
def run(
    scene: str | None,
    fmu: Path | None,
    values: tuple[str, ...],
    stop: float | None,
    tolerance: float,
    out: Path,
    quiet: bool,
    as_json: bool,
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
        run_any(fmu, stop, tolerance, values, out, quiet, as_json)
        return
    if scene is None or fmu is not None or values or stop is not None:
        raise click.UsageError("name one SCENE, or --fmu PATH; --set and --stop go with --fmu")
    from ..scenes.scene import load
    from ..studies.run import job
    from ..studies.run.table import comparison

    chosen = load(scene)
    with progress(quiet or as_json, 1) as report:
        outcome = job.perform(chosen, out, partial(report, chosen.name))
    table = comparison([outcome], everything=True)
    answer(quiet, as_json, figures(outcome), table, f"Results in {out / chosen.name}")


def run_any(
    path: Path, stop: float | None, tolerance: float, values: tuple[str, ...], out: Path, quiet: bool, as_json: bool
) -> None:
    """What `run --fmu` does."""
    from ..results.files import heading
    from ..scenes.assigned import assigned
    from ..studies.run.any_fmu import perform_run

    with progress(quiet or as_json, 1) as report:
        given = dict(map(assigned, values))
        found, folder = perform_run(path, stop, tolerance, given, out, partial(report, path.stem))
    ends = {name: float(column[-1]) for name, column in found.columns.items()}
    if as_json:
        tell({"fmu": found.name, "note": found.note, "final": ends, "folder": str(folder)})
    elif not quiet:
        for name, value in ends.items():
            click.echo(f"{heading(name, found.units[name])}: from {found.columns[name][0]:.6g} to {value:.6g}")
        click.echo(f"{found.note}\nResults in {folder}")


def figures(outcome: Any) -> dict[str, object]:
    """What a scene gave, for JSON."""
    return {"scene": outcome.name, "quantities": outcome.quantities, "error": outcome.error}
