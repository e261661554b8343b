"""list: the scenes that come with the harness."""

import click

from .terminal import Terminal, json_option


@click.command("list")
@json_option
def list_(as_json: bool) -> None:
    """List the scenes that come with the harness: single FMUs for `run`, coupled FMUs for `couple`.

    \b
    Example:
      python -m harness list --json
    """
    from rich.table import Table

    from ..scenes.coupled import scene as coupled
    from ..scenes.scene import load_scene, shipped_scenes
    from ..scenes.schema import parse_table, read_toml

    rows = [("run", scene.name, scene.run.fmu.stem, scene.title) for scene in map(load_scene, shipped_scenes())]
    for file in coupled.shipped_coupled_scenes():
        keys = parse_table(read_toml(file), coupled.CoupledKeys)
        models = ", ".join(part.model for part in keys.parts.values())
        rows.append(("couple", file.stem, models, keys.title))
    table = Table(*HEADINGS, box=None, padding=(0, 1, 0, 0))
    for row in rows:
        table.add_row(*row)
    Terminal(False, as_json).print_result([dict(zip(HEADINGS, row, strict=True)) for row in rows], table)


HEADINGS = ("command", "scene", "model", "title")
