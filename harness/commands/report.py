"""report: an HTML page of all results."""

from pathlib import Path

import click

from .terminal import SectionedCommand, json_option, out_option, print_json, quiet_option


@click.command(cls=SectionedCommand)
@out_option("Folder with the results; the page is written to it.")
@click.option("--title", default="Results", show_default=True, help="Title of the page.")
@quiet_option
@json_option
def report(out: Path, title: str, quiet: bool, as_json: bool) -> None:
    """Write report.html, a page of all results in a folder, with their figures.

    The command runs nothing.

    \b
    Example:
      friction-fmus run coulomb && friction-fmus decay coulomb && friction-fmus report --title "My sled"
    """
    from ..report.page import write_report

    page = write_report(out, title)
    if as_json:
        print_json({"page": str(page)})
    elif not quiet:
        click.echo(f"Report in {page}")
