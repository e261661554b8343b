"""couple: several FMUs in one scene."""

from functools import partial
from pathlib import Path

import click

from .terminal import STOP, progress, results, tell


@click.command()
@click.argument("scene")
@STOP
@results
def couple(scene: str, stop: float | None, out: Path, quiet: bool, as_json: bool) -> None:
    """Couple the FMUs of a SCENE: written as an SSP archive, run by Ecos beside a monolithic reference, and by libcosim
    and fmpy where they can.

    SCENE is two-masses, driven, chain, or the path of a TOML file; harness/scenes/coupled/scene.py says what it may
    hold.  Or it is the path of an archive (.ssp) of anyone's, which is run beside its own finest run; --stop is for one
    that names no stop time.

    \b
    Examples:
      python -m harness couple two-masses
      python -m harness couple my-pair.toml --out elsewhere
      python -m harness couple theirs.ssp --stop 10
    """
    from ..studies.coupled.study import perform

    with progress(quiet or as_json, 1) as report:
        found, folder = perform(scene, out, stop, partial(report, scene))
    if as_json:
        engines = {name: {"largest error": off, "why not": why} for name, (_, off, why) in found.engines.items()}
        told = {"steps": found.steps, "errors": found.errors, "order": found.order, "engines": engines}
        tell(told | {"folder": str(folder)})
    elif not quiet:
        click.echo(f"communication step [s]   largest error{f' [{found.unit}]' if found.unit else ''}")
        for step, error in zip(found.steps, found.errors, strict=False):
            click.echo(f"{step:<24g} {error:.3e}")
        click.echo(f"The error falls with the power {found.order:.2f} of the step.")
        for name, (_, off, why) in found.engines.items():
            click.echo(f"{name:<24} {why or f'{off:.3e} with the finest step'}")
        click.echo(f"Results in {folder}")
