"""suite: the friction suite for developers of tools."""

import json
import shutil
from pathlib import Path

import click
from rich.table import Table

from harness.commands.terminal import Terminal, json_option


@click.command()
@click.argument("folder", metavar="OUT", type=click.Path(file_okay=False, path_type=Path))
@click.option("--case", "names", multiple=True, help="Write only this case; repeatable.")
@click.option("--platform", "platforms", multiple=True, help="Compile only for this platform; repeatable.")
@click.option("--archive", "archives", is_flag=True, help="Also write OUT.zip, which a release has as an attachment.")
@click.option("--run", "runs", is_flag=True, help="Run the cases in the importers that are installed, and judge them.")
@json_option
def suite(
    folder: Path, names: tuple[str, ...], platforms: tuple[str, ...], archives: bool, runs: bool, as_json: bool
) -> None:
    """Write the friction suite to the folder OUT: hard cases with certified results, and check.py, which judges a tool.

    With --run, also run the cases in fmpy, in the importers that are installed, and in three that are wrong on purpose;
    the results are in OUT/results.

    \b
    Examples:
      python -m benchmarks suite suite
      python -m benchmarks suite suite --platform linux64 --run
      python -m benchmarks suite dist/friction-suite --archive
    """
    from harness.errors import check_names

    from .cases import CASES
    from .writer import write_suite

    check_names("case", names, [case.name for case in CASES])
    cases = [case for case in CASES if not names or case.name in names]
    terminal = Terminal(as_json)
    with terminal.progress(1) as report:
        write_suite(cases, folder, platforms, lambda share: report("suite", share))
    if archives:
        shutil.make_archive(str(folder), "zip", folder.resolve().parent, folder.name)
    index = json.loads((folder / "cases.json").read_text(encoding="utf-8"))
    if not runs:
        terminal.print_result(
            index, f"{len(cases)} cases in {folder}; judge results by python {folder}/check.py RESULTS"
        )
        return
    from .importers import available_runners, run_case

    verdicts = {
        importer: {
            name: run_case(run, folder / name, folder / "results" / importer, case) for name, case in index.items()
        }
        for importer, run in available_runners().items()
    }
    table = Table("importer", "passed", "failed", "not run", box=None)
    for importer, by_case in verdicts.items():
        groups = {
            word: [name for name, text in by_case.items() if text.startswith(word)]
            for word in ("passed", "failed", "not run")
        }
        table.add_row(importer, str(len(groups["passed"])), ", ".join(groups["failed"]), ", ".join(groups["not run"]))
    terminal.print_result(verdicts, table)
