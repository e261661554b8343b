"""list: the shipped scenes."""

import click

from .terminal import Terminal, json_option

HEADINGS = ("command", "scene", "model", "title")


@click.command("list")
@json_option
def list_(as_json: bool) -> None:
    """List the shipped scenes and models for `run`.

    A model without a scene file is listed by its name: build it by this name; `run` then uses its defaults.

    \b
    Example:
      friction-fmus list --json
    """
    from rich.table import Table

    from ..scenes.fmu_files import model_title, more_model_files
    from ..scenes.scene import load_scene, shipped_scenes

    rows = [("run", scene.name, scene.run.fmu.stem, scene.title) for scene in map(load_scene, shipped_scenes())]
    rows += [("run", file.stem, file.stem, model_title(file)) for file in more_model_files()]
    table = Table(*HEADINGS, box=None, padding=(0, 1, 0, 0))
    for row in rows:
        table.add_row(*row)
    Terminal(False, as_json).print_result([dict(zip(HEADINGS, row, strict=True)) for row in rows], table)
