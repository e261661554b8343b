"""list: the scenes that there are."""

import click


@click.command("list")
def list_() -> None:
    """List the scenes that come with the harness."""
    from rich.console import Console
    from rich.table import Table

    from ..scenes.scene import load, shipped

    table = Table("scene", "model", "title", box=None)
    for file in shipped():
        scene = load(file)
        table.add_row(scene.name, scene.file.stem, scene.title)
    Console().print(table)
