"""The command line: parse, one call, print."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from . import job
from .errors import HarnessError
from .scene import load, shipped
from .table import comparison

OUT = click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("results"),
    show_default=True,
    help="Folder that receives one folder for each scene.",
)
QUIET = click.option("--quiet", is_flag=True, help="Print errors only.")


@click.group(invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@OUT
@QUIET
@click.pass_context
def commands(context: click.Context, out: Path, quiet: bool) -> None:
    """Run the built FMUs, measure what they do, and set it beside what was published.

    Without a command: every published case.  Exit status 0: all well, 1: a run failed, 2: wrong usage.

    \b
    Examples:
      python -m harness
      python -m harness run stickslip
      python -m harness run my-scene.toml --out elsewhere
      python -m harness list
    """
    context.default_map = {"run": {"out": out, "quiet": quiet}}  # given before the command, they hold for it too
    if context.invoked_subcommand is None:
        names = job.published()
        with progress(quiet, len(names)) as report:
            outcomes = list(job.main_job(names, out, report))
        show(quiet, comparison(outcomes, everything=False), out)
        failed = [outcome.error for outcome in outcomes if outcome.error]
        if failed:
            raise HarnessError("\n".join(failed))


@commands.command()
@click.argument("scene")
@OUT
@QUIET
def run(scene: str, out: Path, quiet: bool) -> None:
    """Run one SCENE: a shipped name (see list) or the path of a TOML file.

    \b
    Examples:
      python -m harness run pendulum
      python -m harness run ./my-scene.toml --out elsewhere
    """
    chosen = load(scene)
    with progress(quiet, 1) as report:
        outcome = job.perform(chosen, out, partial(report, chosen.name))
    show(quiet, comparison([outcome], everything=True), out / chosen.name)


@commands.command("list")
def list_() -> None:
    """List the scenes that come with the harness."""
    table = Table("scene", "model", "title", box=None)
    for file in shipped():
        scene = load(file)
        table.add_row(scene.name, scene.model, scene.title)
    Console().print(table)


@contextmanager
def progress(quiet: bool, total: int) -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error, gone at the end; yields what tells it the present scene and its share done."""
    console = Console(file=sys.stderr)  # this very stream: runs redirect sys.stderr
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    hidden = quiet or not console.is_terminal
    with Progress(*columns, console=console, transient=True, redirect_stderr=False, disable=hidden) as bar:
        task = bar.add_task("", total=total)
        done: list[str] = []

        def report(name: str, share: float) -> None:
            if name not in done:
                done.append(name)
            bar.update(task, description=name, completed=len(done) - 1 + share)

        yield report


def show(quiet: bool, table: Table, where: Path) -> None:
    """Print the table and where the results are."""
    if not quiet:
        console = Console()
        console.print(table)
        console.print(f"Results in {where}", highlight=False)


def main() -> None:
    """Run the command line; what a user can cause ends in a sentence and a status."""
    try:
        commands()
    except HarnessError as error:
        click.echo(f"Error: {error}", err=True)
        sys.exit(error.status)


if __name__ == "__main__":
    main()
