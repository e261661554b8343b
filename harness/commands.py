"""The command line: parse, one call, print."""

from functools import partial
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from . import job
from .answers import COMMANDS, STOP, TOLERANCE, run_any
from .errors import HarnessError
from .scene import load, shipped
from .table import comparison
from .terminal import JSON, OUT, QUIET, as_text, progress


@click.group(invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@OUT
@QUIET
@JSON
@click.pass_context
def commands(context: click.Context, out: Path, quiet: bool, as_json: bool) -> None:
    """Run the built FMUs, measure what they do, and set it beside what was published.

    Without a command: every published case.  Exit status 0: all well, 1: a run failed, 2: wrong usage,
    130 and 143: ended by Ctrl-C and by SIGTERM, with nothing left half done.

    \b
    Examples:
      python -m harness
      python -m harness run stickslip
      python -m harness run my-scene.toml --out elsewhere
      python -m harness list
    """
    given = {"out": out, "quiet": quiet, "as_json": as_json}  # before the command, they hold for it too
    context.default_map = dict.fromkeys(commands.commands, given)
    if context.invoked_subcommand is None:
        names = job.published()
        with progress(quiet or as_json, len(names)) as report:
            outcomes = list(job.main_job(names, out, report))
        if as_json:
            click.echo(as_text([figures(outcome) for outcome in outcomes]))
        else:
            show(quiet, comparison(outcomes, everything=False), out)
        failed = [outcome.error for outcome in outcomes if outcome.error]
        if failed:
            raise HarnessError("\n".join(failed))


@commands.command()
@click.argument("scene", required=False)
@click.option("--fmu", type=click.Path(path_type=Path), help="Run this FMU, of any origin, instead of a scene.")
@click.option("--set", "values", multiple=True, metavar="NAME=VALUE", help="With --fmu: a value to set.")
@STOP
@TOLERANCE
@OUT
@QUIET
@JSON
def run(
    scene: str | None,
    fmu: Path | None,
    values: tuple[str, ...],
    stop: float | None,
    tolerance: float,
    out: Path,
    quiet: bool,
    as_json: bool,
) -> None:
    """Run one SCENE: a shipped name (see list) or the path of a TOML file.  Or run an FMU of any origin.

    An FMU that does not show its solver's steps is run with ever shorter communication steps, until halving them
    changes no output by more than the tolerance.

    \b
    Examples:
      python -m harness run pendulum
      python -m harness run ./my-scene.toml --out elsewhere
      python -m harness run --fmu theirs.fmu --set mass=2 --stop 10 --tolerance 1e-4
    """
    if fmu is not None and scene is None:
        run_any(fmu, stop, tolerance, values, out, quiet, as_json)
        return
    if scene is None or fmu is not None or values or stop is not None:
        raise click.UsageError("name one SCENE, or --fmu PATH; --set and --stop go with --fmu")
    chosen = load(scene)
    with progress(quiet or as_json, 1) as report:
        outcome = job.perform(chosen, out, partial(report, chosen.name))
    if as_json:
        click.echo(as_text(figures(outcome)))
    else:
        show(quiet, comparison([outcome], everything=True), out / chosen.name)


@commands.command()
@click.argument("models", metavar="[MODEL]...", nargs=-1)
@OUT
@QUIET
@JSON
@click.option("--quick", is_flag=True, help="Three tolerances only, and little patience.")
def precision(models: tuple[str, ...], out: Path, quiet: bool, as_json: bool, quick: bool) -> None:
    """Show what accuracy costs: error against run time and right-hand sides, for each MODEL (without one: all).

    \b
    Examples:
      python -m harness precision
      python -m harness precision pacejka --quick
    """
    from .precision import table as tables
    from .precision.study import FULL, QUICK
    from .precision.survey import FOLDER, MODELS, survey

    with progress(quiet or as_json, len(models or MODELS) + 1) as report:
        found = survey(models or MODELS, QUICK if quick else FULL, out, report)
    if as_json:
        points = {study.model: study.points for study in found.studies}
        rest = {"laws": found.laws, "anchors": found.anchors, "advice": found.advice, "missing": found.missing}
        click.echo(as_text({"points": points} | rest))
    elif not quiet:
        errors = (tables.exchange(found.studies), tables.laws(found.laws), tables.anchors(found.anchors))
        for table in (*map(tables.work, found.studies), *errors):
            Console().print(table, "")
        for sentence in (*found.advice, *found.missing):
            Console().print(sentence, highlight=False)
        Console().print(f"Results in {out / FOLDER}", highlight=False)


@commands.command()
@OUT
@QUIET
@JSON
def stability(out: Path, quiet: bool, as_json: bool) -> None:
    """Run stiff and extreme scenes with every method: each ends right, or is refused with a sentence.

    Exit status 1 if one ends otherwise.

    \b
    Example:
      python -m harness stability
    """
    from .stability import table as tables
    from .stability.study import FOLDER, all_cases, survey

    chosen = all_cases()
    with progress(quiet or as_json, sum(map(len, chosen))) as report:
        rows, regions = survey(out, report, chosen)
    if as_json:
        click.echo(as_text([{"scene": row.case.label, "well": row.well, "ended": row.ended} for row in rows]))
    elif not quiet:
        Console().print(tables.endings(rows), "", tables.refusals(rows), "")
        Console().print(tables.summary(rows, regions), f"Results in {out / FOLDER}", sep="\n", highlight=False)
    wrong = [f"{row.case.label}: {row.text}" for row in rows if not row.well]
    if wrong:
        raise HarnessError("\n".join(wrong))


@commands.command()
@OUT
@QUIET
@JSON
def bench(out: Path, quiet: bool, as_json: bool) -> None:
    """Measure the numbers to reach, each beside what it is compared with in the same run.

    \b
    Example:
      python -m harness bench
    """
    from .bench import study as work
    from .bench.table import numbers

    chosen = work.measures()
    with progress(quiet or as_json, len(chosen)) as report:
        found = work.bench(chosen, out, report)
    if as_json:
        click.echo(as_text(found))
    else:
        show(quiet, numbers(found), out / work.FOLDER)


@commands.command()
@click.option("--fmus", type=click.Path(file_okay=False, path_type=Path), default=Path("fmus"), show_default=True)
@OUT
@QUIET
@JSON
def importers(fmus: Path, out: Path, quiet: bool, as_json: bool) -> None:
    """Run the FMUs of a folder in tools that others wrote, and set their answers beside fmpy's.

    Exit status 1 if a check fails.  A tool that is not installed is named.

    \b
    Examples:
      python -m harness importers
      python -m harness importers --fmus fmus/native
    """
    from .importers import table as work
    from .importers.checks import IMPORTERS

    with progress(quiet or as_json, len(IMPORTERS)) as report:
        rows = work.rows(fmus, report)
    work.save(rows, out)
    if as_json:
        click.echo(as_text(rows))
    elif not quiet:
        Console().print(work.table(rows))
    failed = [f"{row.importer}, {row.check}: {', '.join(row.failed)}" for row in rows if row.failed]
    if failed:
        raise HarnessError("\n".join(failed))


@commands.command("list")
def list_() -> None:
    """List the scenes that come with the harness."""
    table = Table("scene", "model", "title", box=None)
    for file in shipped():
        scene = load(file)
        table.add_row(scene.name, scene.model, scene.title)
    Console().print(table)


def figures(outcome: job.Outcome) -> dict[str, object]:
    """What a scene gave, for JSON."""
    return {"scene": outcome.name, "quantities": outcome.quantities, "error": outcome.error}


def show(quiet: bool, table: Table, where: Path) -> None:
    """Print the table and where the results are."""
    if not quiet:
        console = Console()
        console.print(table)
        console.print(f"Results in {where}", highlight=False)


for command in COMMANDS:
    commands.add_command(command)
