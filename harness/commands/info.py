"""info: scenes and models, and the variables of a model or an FMU."""

import click

from .terminal import SectionedCommand, Terminal, json_option

SOURCE_HEADINGS = ("scene", "model", "title")


@click.command(cls=SectionedCommand)
@click.argument("model", metavar="[MODEL|FMU]", required=False)
@json_option
def info(model: str | None, as_json: bool) -> None:
    """List the variables of MODEL: units, start values, ranges, friction laws, methods, defaults, and lookup tables.

    MODEL is the name of a model, or the path of any FMU, FMI 2.0 or 3.0.  The FMU is read, not run.  Without MODEL, the
    command lists the scenes and models that `run` knows by name.

    \b
    Examples:
      friction-fmus info
      friction-fmus info stickslip
      friction-fmus info other.fmu --json
    """
    terminal = Terminal(as_json)
    if model is None:
        list_sources(terminal)
        return
    from ..scenes.fmu_files import find_fmu
    from ..simulation.fmu_variables import describe_fmu

    description = describe_fmu(find_fmu(model))
    terminal.print_result(description.as_json(), *description.blocks())


def list_sources(terminal: Terminal) -> None:
    """Print the built-in scenes, and the models that have none; these are built by their name and run as they are."""
    from rich.table import Table

    from ..scenes.fmu_files import model_title, more_model_files
    from ..scenes.scene import load_scene, shipped_scenes

    rows = [(scene.name, scene.run.fmu.stem, scene.title) for scene in map(load_scene, shipped_scenes())]
    rows += [("", file.stem, model_title(file)) for file in more_model_files()]
    table = Table(*SOURCE_HEADINGS, box=None, padding=(0, 1, 0, 0))
    for row in rows:
        table.add_row(*row)
    terminal.print_result([dict(zip(SOURCE_HEADINGS, row, strict=True)) for row in rows], table)
