"""report: one page of all results."""

from pathlib import Path

import click

from .terminal import json_option, out_option, print_json, quiet_option


@click.command()
@out_option("Folder of the results; the page is written into it.")
@quiet_option
@json_option
def report(out: Path, quiet: bool, as_json: bool) -> None:
    """Make one page of all results there are: report.html, which needs nothing else.

    It runs nothing; it says which results are missing, and the commands that make them.  The page that runs is in it,
    where `python build_fmus.py --web` has written it.

    \b
    Example:
      python -m harness && python -m harness decay coulomb && python -m harness report
    """
    from ..report.page import write_report
    from ..report.sections import PublishedScene
    from ..scenes.scene import load_scene, shipped_scenes

    scenes = [scene for scene in map(load_scene, shipped_scenes()) if scene.published]
    found = write_report(out, [PublishedScene(scene.name, scene.file.stem, scene.about) for scene in scenes])
    if as_json:
        print_json({"page": str(found.path), "missing": [name for name, _ in found.missing]})
    elif not quiet:
        for name, command in found.missing:
            click.echo(f"Missing: {name}; make it with `{command}`")
        click.echo(f"Report in {found.path}")
