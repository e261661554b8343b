"""Commands that answer a user's questions: what a decay says, what happens over many parameters, what differs."""

import os
from functools import partial
from math import isfinite, isnan
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from .errors import LONGEST, HarnessError
from .run import heading
from .terminal import JSON, OUT, QUIET, as_text, progress


class Number(click.FloatRange):
    """A finite number, in a range or not; click lets NaN through, which is in no range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        return number


NUMBER, POSITIVE, WORKERS = Number(), Number(min=0, min_open=True), click.IntRange(1, 1024)
TOLERANCE = click.option(
    "--tolerance",
    type=POSITIVE,
    default=1e-6,
    show_default=True,
    help="To which an FMU that does not show its steps is run, relative.",
)
STOP = click.option("--stop", type=NUMBER, help="Stop time in s (the FMU's own).")


@click.command()
@click.argument("source", metavar="FILE|SCENE|-")
@click.option("--time", help="Heading of the time, as it stands in the file (t, time, ..., or the first column).")
@click.option("--position", help="Heading of what is to be fitted, as it stands in the file (x, theta, ...).")
@click.option("--velocity", help="The same, of a velocity.")
@click.option(
    "--quantity",
    type=click.Choice(("position", "velocity", "acceleration")),
    help="What was measured, where its unit does not tell (an angle is a position).",
)
@click.option("--unit", help="Its unit where the heading has none, as in mm, deg/s or g.")
@click.option("--per-count", metavar="SIZE", help="What one count is, as in 0.36deg or 0.001mm.")
@click.option("--time-unit", help="Unit of the time where the heading has none (s).")
@click.option("--columns", "names", metavar="NAMES", help="Headings where the file has none: 't [s],x [mm]'.")
@click.option("--from", "begin", type=click.FLOAT, default=float("-inf"), help="Leave out what is before, in s.")
@click.option("--until", "end", type=click.FLOAT, default=float("inf"), help="Leave out what is after, in s.")
@click.option("--k", type=POSITIVE, help="Stiffness, N/m (N.m/rad): gives friction force.")
@click.option("--m", type=POSITIVE, help="Mass, kg (kg.m2), in place of k.")
@click.option("--pendulum", is_flag=True, help="The restoring torque is k sin(theta), k = m g a.")
@click.option("--drag/--no-drag", default=True, show_default=True, help="Try the laws with quadratic drag.")
@click.option("--drift", is_flag=True, help="Let the rest position (or the offset of a sensor) drift steadily.")
@OUT
@QUIET
@JSON
def decay(
    source: str,
    time: str | None,
    position: str | None,
    velocity: str | None,
    quantity: str | None,
    unit: str | None,
    per_count: str | None,
    time_unit: str | None,
    names: str | None,
    begin: float,
    end: float,
    k: float | None,
    m: float | None,
    pendulum: bool,
    drag: bool,
    drift: bool,
    out: Path,
    quiet: bool,
    as_json: bool,
) -> None:
    """Tell damping, dry friction and drag from the decay in a FILE with columns, or in the run of a SCENE.

    A FILE is text with any delimiter, a spreadsheet (.xlsx, .ods), a .mat or .npz file; - is standard input.  Headings
    tell names and units, as in "x [mm]" or "Gyroscope z (rad/s)"; a unit tells whether it is a position, a velocity or
    an acceleration.  The record may start and end anywhere, be noisy, uneven in time, with a gap, and off its rest
    position.

    Zeta, r = f/k and b = q/m are told with 95 % intervals, which hold whatever the law; what is in doubt is said, and
    what is not the free decay of one oscillator is refused.

    \b
    Examples:
      a phone on a spring:    python -m harness decay "Raw Data.csv" --m 0.35
      a spreadsheet:          python -m harness decay swing.xlsx --position "laser (mm)" --k 157.9
      a pendulum's encoder:   python -m harness decay swing.txt --pendulum --per-count 0.36deg --columns t,count
      a column of a pipe:     zcat swing.gz | python -m harness decay - --unit mm --from 2.5
      a scene:                python -m harness decay coulomb
    """
    from .identify import job as decays
    from .identify.columns import Columns
    from .identify.figures import Known
    from .identify.table import sentences, table

    if k is not None and m is not None:
        raise click.UsageError("--k and --m: give one of them; the frequency tells the other")
    if velocity is not None:
        if position is not None or quantity not in (None, "velocity"):
            raise click.UsageError("--velocity: one column is fitted; leave out --position and --quantity")
        position, quantity = velocity, "velocity"
    columns = Columns(time, position, quantity, unit, time_unit, per_count, names, begin, end)
    with progress(quiet or as_json, 1) as report:
        tell = partial(report, "standard input" if source == "-" else source)
        found, folder = decays.perform(source, columns, Known(k, m, pendulum), drag, drift, out, tell)
    if as_json:
        click.echo(as_text(decays.numbers(found)))
    elif not quiet:
        console = Console()
        console.print(table(found), "")
        for sentence in (*sentences(found), f"Results in {folder}"):
            console.print(sentence, highlight=False)


@click.command()
@click.argument("model")
@click.option(
    "--vary", multiple=True, required=True, metavar="NAME=LO:HI:N", help="What to vary; :log at the end, or a,b,c."
)
@click.option("--set", "values", multiple=True, metavar="NAME=VALUE", help="What to set in every run.")
@click.option(
    "--random", type=click.IntRange(min=1), help="So many points of a Latin hypercube; then --vary NAME=LO:HI."
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of the Latin hypercube.")
@click.option("--measure", default="final,events", show_default=True, help="What to measure, with commas between.")
@STOP
@click.option("--workers", type=WORKERS, default=lambda: os.cpu_count() or 1, help="Processes on this machine.")
@click.option("--scheduler", metavar="ADDRESS", help="An existing Dask cluster, as in tcp://host:8786.")
@click.option("--name", help="Name of the result folder.")
@OUT
@QUIET
@JSON
def sweep(
    model: str,
    vary: tuple[str, ...],
    values: tuple[str, ...],
    random: int | None,
    seed: int,
    measure: str,
    stop: float | None,
    workers: int,
    scheduler: str | None,
    name: str | None,
    out: Path,
    quiet: bool,
    as_json: bool,
) -> None:
    """Run MODEL (a name, or the path of an FMU) over many parameters, and measure every run.

    Measures: final, events, steps, evaluations, run_time; along the path also slips, period, unsteady, peak_speed,
    stuck, rest, zeta, f_over_k.  Interrupted, the same command goes on where it was.

    \b
    Examples:
      python -m harness sweep stickslip --vary mu_d=0.3:0.9:60 --vary v_driver=0.01:0.5:60 --measure slips,period
      python -m harness sweep pacejka --vary x_m=0.001:0.1:40:log --measure unsteady,steps
      python -m harness sweep coulomb --vary f=0.1:2 --vary k=50:500 --random 1000 --scheduler tcp://host:8786
    """
    if name is not None and (name.startswith(".") or Path(name).name != name):
        raise click.UsageError(f"--name {name[:LONGEST]}: the name of one folder, without dots before it")
    try:
        from .sweep import file as sweep_file
    except ImportError as error:
        raise HarnessError(f"a sweep needs {error.name}: python -m pip install 'friction-fmus[sweep]'") from None
    measures = tuple(dict.fromkeys(word.strip() for word in measure.split(",")))
    asked = sweep_file.Asked(model, vary, values, random, seed, measures, stop, name)
    with progress(quiet or as_json, 1) as report:
        swept = sweep_file.carry_out(asked, out, scheduler, workers, partial(report, model))
    runs = swept.data["error"].size
    told = {
        "runs": runs,
        "done before": swept.before,
        "damaged": swept.damaged,
        "failed": swept.failed,
        "seconds": swept.seconds,
        "folder": str(swept.folder),
    }
    if as_json:
        click.echo(as_text(told))
    elif not quiet:
        fresh = runs - swept.before
        click.echo(f"{runs} runs, {swept.before} of them done before, {swept.failed} failed")
        if swept.damaged:
            click.echo(f"{swept.damaged} damaged lines of the earlier sweep's journal were left out, and run again")
        if fresh:
            click.echo(f"{fresh} runs in {swept.seconds:.3g} s: {fresh / swept.seconds:.4g} runs/s")
        click.echo(f"Results in {swept.folder}")


@click.command()
@click.argument("one", metavar="A")
@click.argument("two", metavar="B")
@STOP
@TOLERANCE
@click.option("--within", type=Number(min=0), help="Exit status 1 if a relative difference is larger.")
@OUT
@QUIET
@JSON
def compare(
    one: str,
    two: str,
    stop: float | None,
    tolerance: float,
    within: float | None,
    out: Path,
    quiet: bool,
    as_json: bool,
) -> None:
    """Show how far A and B are apart: FMUs of any origin (FMI 2.0, 3.0), scenes, result folders or CSV files.

    \b
    Examples:
      python -m harness compare results/stickslip results/stickslip-threshold
      python -m harness compare fmus/coulomb.fmu theirs.fmu --stop 2
      python -m harness compare results/smd measured.csv --within 1e-3
    """
    from .compare import job as anyones

    with progress(quiet or as_json, 1) as report:
        found, folder = anyones.perform_compare((one, two), stop, tolerance, out, partial(report, "compare"))
    if as_json:
        click.echo(as_text(anyones.numbers(found)))
    elif not quiet:
        console = Console()
        console.print(anyones.table(found), "")
        for sentence in (*anyones.sentences(found), f"Results in {folder}"):
            console.print(sentence, highlight=False)
    if within is not None and not (found.worst <= within and (found.shift is None or found.shift == found.shift)):
        if isnan(found.worst):
            raise HarnessError(f"{one} or {two} holds what is not a finite number, which is in no bound")
        raise HarnessError(f"{one} and {two} differ by {found.worst:.3g} of the largest value, more than {within:g}")


@click.command()
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("results"),
    show_default=True,
    help="Folder of the results; the page is written into it.",
)
@QUIET
@JSON
def report(out: Path, quiet: bool, as_json: bool) -> None:
    """Make one page of all results there are: report.html, which needs nothing else.

    It runs nothing; it says which results are missing, and the commands that make them.

    \b
    Example:
      python -m harness && python -m harness decay coulomb && python -m harness report
    """
    from .report.page import write

    found = write(out)
    if as_json:
        click.echo(as_text({"page": str(found.path), "missing": [name for name, _ in found.missing]}))
    elif not quiet:
        for name, command in found.missing:
            click.echo(f"Missing: {name}; make it with `{command}`")
        click.echo(f"Report in {found.path}")


@click.command()
@click.argument("scene")
@OUT
@QUIET
@JSON
def couple(scene: str, out: Path, quiet: bool, as_json: bool) -> None:
    """Couple the FMUs of a SCENE: written as an SSP archive, run by Ecos, beside a monolithic reference.

    SCENE is two-masses, driven, or the path of a TOML file; harness/coupled/scene.py says what it may hold.

    \b
    Examples:
      python -m harness couple two-masses
      python -m harness couple my-pair.toml --out elsewhere
    """
    from .coupled.study import perform

    with progress(quiet or as_json, 1) as report:
        found, folder = perform(scene, out, partial(report, scene))
    if as_json:
        click.echo(as_text({"steps": found.steps, "errors": found.errors, "order": found.order, "folder": str(folder)}))
    elif not quiet:
        click.echo("communication step [s]   largest error of a position [m]")
        for step, error in zip(found.steps, found.errors, strict=True):
            click.echo(f"{step:<24g} {error:.3e}")
        click.echo(f"The error falls with the power {found.order:.2f} of the step.\nResults in {folder}")


COMMANDS: tuple[click.Command, ...] = (decay, sweep, compare, couple, report)


def run_any(
    path: Path, stop: float | None, tolerance: float, values: tuple[str, ...], out: Path, quiet: bool, as_json: bool
) -> None:
    """What `run --fmu` does."""
    from .compare.job import perform_run
    from .sweep.space import assigned

    with progress(quiet or as_json, 1) as report:
        given = dict(map(assigned, values))
        found, folder = perform_run(path, stop, tolerance, given, out, partial(report, path.stem))
    ends = {name: float(column[-1]) for name, column in found.columns.items()}
    if as_json:
        click.echo(as_text({"fmu": found.name, "note": found.note, "final": ends, "folder": str(folder)}))
    elif not quiet:
        for name, value in ends.items():
            click.echo(f"{heading(name, found.units[name])}: from {found.columns[name][0]:.6g} to {value:.6g}")
        click.echo(f"{found.note}\nResults in {folder}")
