"""importers: check the FMUs in other tools."""

from pathlib import Path

import click

from harness.commands.terminal import Terminal, result_options


@click.command()
@click.option("--fmus", type=click.Path(file_okay=False, path_type=Path), default=Path("fmus"), show_default=True)
@result_options
def importers(fmus: Path, terminal: Terminal) -> None:
    """Run the FMUs of a folder in other simulation tools, and compare the results with those of fmpy.

    Tools that are not installed are listed and skipped.  Exit status 1 if a check fails.

    \b
    Examples:
      python -m benchmarks importers
      python -m benchmarks importers --fmus fmus/native
    """
    from . import table as checks
    from .checks import IMPORTERS

    with terminal.progress(len(IMPORTERS)) as report:
        rows = checks.run_importer_checks(fmus, terminal.out, report)
    failures = (f"{row.importer}, {row.check}: {', '.join(row.failed)}" for row in rows if row.failed)
    output = (checks.importer_table(rows), *checks.legend_lines(rows))
    terminal.print_result(rows, *output, folder=terminal.out / checks.FOLDER, failures=failures)
