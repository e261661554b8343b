"""references: certified results for models of one's own."""

from pathlib import Path

import click

from .terminal import Terminal, json_option, quiet_option

FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.command()
@click.argument("files", metavar="FILE.py...", nargs=-1, required=True, type=FILE)
@quiet_option
@json_option
def references(files: tuple[Path, ...], quiet: bool, as_json: bool) -> None:
    """Write the certified result of the model in each FILE.py, whose FMU is built, beside it: FILE.csv.

    The default run is made by two methods that share no formula; where they agree, the FMU carries the result from its
    next build on, and its page shows it.  Where it sticks, FILE-events.csv has the changes of mode.  Our own models
    come by closed forms, series and other people's solvers, under all of their laws, in some minutes.

    \b
    Example:
      python -m harness references belt.py
    """
    from ..references.certification import certify

    made = [one for file in files for one in certify(file)]
    shown = (f"{one.path}, relative difference {one.difference:.1e}" for one in made)
    Terminal(quiet, as_json).print_result(made, *shown)
