"""couple: several FMUs in one scene."""

from functools import partial

import click

from .terminal import POSITIVE, Terminal, result_options


@click.command()
@click.argument("scene")
@click.option("--stop", type=POSITIVE, help="Stop time in s (the one that it names).")
@result_options
def couple(scene: str, stop: float | None, terminal: Terminal) -> None:
    """Couple the FMUs of a SCENE: written as an SSP archive, run by Ecos beside a monolithic reference, and by libcosim
    and fmpy where they can.

    SCENE is two-masses, driven, chain, or the path of a TOML file; harness/scenes/coupled/scene.py says what it may
    hold.  Or it is the path of an archive (.ssp) of anyone's, which is run beside its own finest run.

    \b
    Examples:
      python -m harness couple two-masses
      python -m harness couple my-pair.toml --out elsewhere
      python -m harness couple theirs.ssp --stop 10
    """
    from ..studies.coupled.study import run_coupled

    with terminal.progress(1) as report:
        found, folder = run_coupled(scene, terminal.out, stop, partial(report, scene))
    engines = {name: {"largest error": off, "why not": why} for name, (_, off, why) in found.engines.items()}
    told = {"steps": found.steps, "errors": found.errors, "order": found.order, "engines": engines, "folder": folder}
    shown = [
        f"communication step [s]   largest error{f' [{found.unit}]' if found.unit else ''}",
        *(f"{step:<24g} {error:.3e}" for step, error in zip(found.steps, found.errors, strict=False)),
        f"The error falls with the power {found.order:.2f} of the step.",
        *(f"{name:<24} {why or f'{off:.3e} with the finest step'}" for name, (_, off, why) in found.engines.items()),
    ]
    terminal.print_result(told, *shown, folder=folder)
