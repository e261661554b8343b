"""run: one scene or one FMU."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import HarnessError, RunError
from .terminal import SET_OPTION, SectionedCommand, Terminal, refuse_ignored_options, result_options, run_options

if TYPE_CHECKING:
    from ..studies.run.result import RunResult


@click.command(cls=SectionedCommand)
@click.argument("source", metavar="MODEL|SCENE|FMU")
@SET_OPTION
@run_options
@result_options
@click.pass_context
def run(context: click.Context, source: str, values: tuple[str, ...], run: dict[str, Any], terminal: Terminal) -> None:
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
    from ..simulation.resolve import find_source, prefer_scene

    item = find_source(prefer_scene(source))
    refuse_ignored_options(context, [item] if isinstance(item, Path) else [])
    with terminal.progress(1) as report:
        options = {"values": parse_assignments("--set", values), **run}
        result, folder = run_and_save(source, terminal.out, report, **options)
    failures = [f"{result.failure}; the results up to that time are in {folder}"] if result.failure else []
    content = run_as_json(result, folder) if result.scene else result.as_json() | {"folder": folder}
    terminal.print_result(content, *result.blocks(), folder=folder, failures=failures)


def run_and_save(
    source: str, out: Path, report: Callable[[str, float], None], **options: Any
) -> "tuple[RunResult, Path]":
    """Run a scene, a model or an FMU, also in part, and write the result to out/<its name>."""
    from ..api import simulate
    from ..results.provenance import describe_sources
    from ..results.result import save_result
    from ..simulation.resolve import find_source, prefer_scene

    item = find_source(path := prefer_scene(source))
    is_fmu = isinstance(item, Path)
    name, origin = (item.stem, describe_sources(str(item))) if isinstance(item, Path) else (item.name, item.source)

    def compute() -> "RunResult":
        try:
            return simulate(path, progress=partial(report, name), **options)
        except RunError as error:
            partial_run: RunResult = error.run
            return partial_run

    try:
        return save_result(out / name, compute, "run", origin), out / name
    except HarnessError as error:
        if is_fmu:
            raise
        raise type(error)(f"scene {name}: {error}") from None


def run_as_json(result: "RunResult", folder: Path) -> dict[str, Any]:
    """Return the result of a scene for JSON output, with the note about the result that it replaces."""
    from ..results.provenance import replacement_note

    return result.as_json() | {"said": [*filter(None, [replacement_note(folder)])]}
