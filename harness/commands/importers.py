"""importers: the FMUs in tools that others wrote."""

from pathlib import Path

import click

from ..errors import HarnessError
from .terminal import answer, progress, results


@click.command()
@click.option("--fmus", type=click.Path(file_okay=False, path_type=Path), default=Path("fmus"), show_default=True)
@results
def importers(fmus: Path, out: Path, quiet: bool, as_json: bool) -> None:
    """Run the FMUs of a folder in tools that others wrote, and set their answers beside fmpy's.

    Exit status 1 if a check fails.  A tool that is not installed is named.

    \b
    Examples:
      python -m harness importers
      python -m harness importers --fmus fmus/native
    """
    from ..studies.importers import table as work
    from ..studies.importers.checks import IMPORTERS

    with progress(quiet or as_json, len(IMPORTERS)) as report:
        rows = work.perform(fmus, out, report)
    answer(quiet, as_json, rows, work.table(rows), *work.sentences(rows), folder=out / work.FOLDER)
    failed = [f"{row.importer}, {row.check}: {', '.join(row.failed)}" for row in rows if row.failed]
    if failed:
        raise HarnessError("\n".join(failed))
