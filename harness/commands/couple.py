"""couple: several FMUs in one scene."""

from functools import partial
from pathlib import Path

import click

from .terminal import progress, results, tell


@click.command()
@click.argument("scene")
@results
def couple(scene: str, out: Path, quiet: bool, as_json: bool) -> None:
    """Couple the FMUs of a SCENE: written as an SSP archive, run by Ecos, beside a monolithic reference.

    SCENE is two-masses, driven, or the path of a TOML file; harness/scenes/coupled/scene.py says what it may hold.

    \b
    Examples:
      python -m harness couple two-masses
      python -m harness couple my-pair.toml --out elsewhere
    """
    from ..studies.coupled.study import perform

    with progress(quiet or as_json, 1) as report:
        found, folder = perform(scene, out, partial(report, scene))
    if as_json:
        tell({"steps": found.steps, "errors": found.errors, "order": found.order, "folder": str(folder)})
    elif not quiet:
        click.echo("communication step [s]   largest error of a position [m]")
        for step, error in zip(found.steps, found.errors, strict=True):
            click.echo(f"{step:<24g} {error:.3e}")
        click.echo(f"The error falls with the power {found.order:.2f} of the step.\nResults in {folder}")
