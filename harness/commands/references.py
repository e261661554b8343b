"""references: certified results for user models."""

from pathlib import Path

import click

from .terminal import SectionedCommand, Terminal, json_option

FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.command(cls=SectionedCommand)
@click.argument("files", metavar="FILE.py...", nargs=-1, required=True, type=FILE)
@json_option
def references(files: tuple[Path, ...], as_json: bool) -> None:
    """Compute the certified result of the model in each FILE.py and write it to FILE.csv.  The FMU must be built.

    Two methods that share no formula solve the default run, one of them also with a thirtieth of the largest step.  If
    all agree, FILE.csv is written, and for a model that sticks FILE-events.csv with the changes of mode; the next build
    includes both in the FMU and on its page.

    \b
    Example:
      friction-fmus references belt.py
    """
    from ..references.certification import certify

    results = [result for file in files for result in certify(file)]
    output = (f"{result.path}, relative difference {result.difference:.1e}" for result in results)
    Terminal(as_json).print_result(results, *output)
