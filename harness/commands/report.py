"""report: an HTML page of all results."""

from pathlib import Path

import click

from .terminal import SectionedCommand, out_option


@click.command(cls=SectionedCommand)
@out_option("Folder with the results; the page is written to it.")
@click.option("--title", default="Results", show_default=True, help="Title of the page.")
def report(out: Path, title: str) -> None:
    """Write report.html, a page of all results in a folder, with their figures.

    The command runs nothing.

    \b
    Example:
      friction-fmus run coulomb && friction-fmus decay coulomb && friction-fmus report --title "My sled"
    """
    from ..report.page import write_report

    page = write_report(out, title)
    click.echo(f"Report in {page}")
