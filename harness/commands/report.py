"""report: an HTML page of all results."""

from pathlib import Path

import click

from .terminal import SectionedCommand, out_option


@click.command(cls=SectionedCommand)
@out_option("Folder with the results; the page is written to it.")
def report(out: Path) -> None:
    """Write report.html, a page of all results in a folder, with their figures.

    The command runs nothing.

    \b
    Example:
      friction-fmus run coulomb && friction-fmus decay coulomb && friction-fmus report
    """
    from ..report.page import write_report

    page = write_report(out)
    click.echo(f"Report in {page}")
