"""report: an HTML page of all results."""

from pathlib import Path

import click

from .terminal import SectionedCommand, json_option, out_option, print_json, quiet_option


@click.command(cls=SectionedCommand)
@out_option("Folder with the results; the page is written to it.")
@quiet_option
@json_option
def report(out: Path, quiet: bool, as_json: bool) -> None:
    """Write report.html, a self-contained page of all results.

    The command runs nothing: it lists missing results with the commands that produce them.  The page includes the
    interactive web page if `friction-fmus build --web` has built it.

    \b
    Example:
      friction-fmus && friction-fmus decay coulomb && friction-fmus report
    """
    from ..report.page import write_report
    from ..report.sections import ComparedScene
    from ..scenes.scene import load_scene, shipped_scenes

    scenes = [scene for scene in map(load_scene, shipped_scenes()) if scene.known]
    page = write_report(out, [ComparedScene(scene.name, scene.run.fmu.stem, scene.about) for scene in scenes])
    if as_json:
        print_json({"page": str(page.path), "missing": [gap.name for gap in page.missing]})
    elif not quiet:
        for gap in page.missing:
            click.echo(f"Missing: {gap.name}; run `{gap.command}`")
        click.echo(f"Report in {page.path}")
