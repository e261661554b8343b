"""couple: several coupled FMUs."""

from functools import partial

import click

from .terminal import POSITIVE, Terminal, result_options


@click.command()
@click.argument("scene")
@click.option("--stop", type=POSITIVE, help="Stop time in s. Default: that of the scene.")
@result_options
def couple(scene: str, stop: float | None, terminal: Terminal) -> None:
    """Couple the FMUs of a SCENE.  The scene is written as an SSP archive, run by Ecos, libcosim, fmpy and a
    master of this project, and compared with a single model of the whole system.

    SCENE is two-masses, driven, chain, the path of a TOML file (its keys are described in
    harness/scenes/coupled/scene.py), or the path of an SSP archive (.ssp) of any tool.  An archive is compared with its
    own run at the smallest communication step.  Engines that do not support a feature of it are named.

    \b
    Examples:
      friction-fmus couple two-masses
      friction-fmus couple my-pair.toml --out elsewhere
      friction-fmus couple other.ssp --stop 10
    """
    from ..studies.coupled.study import run_coupled

    with terminal.progress(1) as report:
        result, folder = run_coupled(scene, terminal.out, stop, partial(report, scene))
    terminal.print_result(result.as_json() | {"folder": folder}, *result.blocks(), folder=folder)
