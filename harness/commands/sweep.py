"""sweep: many runs over parameters."""

import os
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import MAX_VALUE_LENGTH, HarnessError
from .terminal import Terminal, result_options, run_options

if TYPE_CHECKING:
    from ..studies.sweep.result_files import SweepResult

MAX_FAILURE_KINDS = 10  # kinds of failures
WORKERS = click.IntRange(1, 1024)


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
@click.option("--measure", help="What to measure, with commas between (final, and events where the FMU counts them).")
@click.option("--workers", type=WORKERS, default=lambda: os.cpu_count() or 1, help="Processes on this machine.")
@click.option("--scheduler", metavar="ADDRESS", help="An existing Dask cluster, as in tcp://host:8786.")
@click.option("--name", help="Name of the result folder.")
@run_options
@result_options
def sweep(
    model: str,
    vary: tuple[str, ...],
    values: tuple[str, ...],
    random: int | None,
    seed: int,
    measure: str | None,
    workers: int,
    scheduler: str | None,
    name: str | None,
    terminal: Terminal,
    **options: Any,
) -> None:
    """Run MODEL (a name, or the path of anyone's FMU) over many parameters, and measure every run.

    Measures of every FMU: final, smallest, largest, run_time; of ours also events, steps, evaluations, peak_speed, and
    where the model has them slips, period, unsteady, stuck, rest, zeta, f_over_k.  Exit status 1 if a run fails.
    Interrupted, the same command goes on where it was.

    \b
    Examples:
      python -m harness sweep stickslip --vary mu_d=0.3:0.9:60 --vary v_driver=0.01:0.5:60 --measure slips,period
      python -m harness sweep pacejka --vary x_m=0.001:0.1:40:log --measure unsteady,steps
      python -m harness sweep theirs.fmu --vary mu=0,0.1,0.2 --measure final,largest
      python -m harness sweep coulomb --vary f=0.1:2 --vary k=50:500 --random 1000 --scheduler tcp://host:8786
    """
    if name is not None and (name.startswith(".") or Path(name).name != name):
        raise click.UsageError(f"--name {name[:MAX_VALUE_LENGTH]}: the name of one folder, without dots before it")
    if find_spec("xarray") is None:  # of which the figure is made, when all runs are done
        raise HarnessError("a sweep needs xarray: python -m pip install 'friction-fmus[sweep]'")
    from ..studies.sweep import result_files as sweep_file

    measures = tuple(dict.fromkeys(word.strip() for word in measure.split(","))) if measure is not None else ()
    asked = sweep_file.SweepRequest(model, vary, values, random, seed, measures, name, options)
    with terminal.progress(1) as report:
        swept = sweep_file.run_sweep(asked, terminal.out, scheduler, workers, partial(report, model))
    fresh = swept.runs - swept.n_resumed
    shown = [f"{swept.runs} runs, {swept.n_resumed} of them done before, {swept.failed} failed"]
    if swept.damaged:
        shown.append(f"{swept.damaged} damaged lines of the earlier sweep's journal were left out, and run again")
    if fresh:
        shown.append(f"{fresh} runs in {swept.seconds:.3g} s: {fresh / swept.seconds:.4g} runs/s")
    terminal.print_result(swept, *shown, folder=swept.folder, failed=describe_failures(swept) if swept.failed else ())


def describe_failures(swept: "SweepResult") -> Iterator[str]:
    """How runs failed, alike ones together."""
    yield f"{swept.failed} of {swept.runs} runs failed; each has its sentence in {swept.folder / 'sweep.csv'}"
    for each in swept.failures[:MAX_FAILURE_KINDS]:
        where = ", ".join(f"{name} = {value!r}" for name, value in each.where.items())
        yield f"{each.runs} like {where}: {each.sentence}"
    if len(swept.failures) > MAX_FAILURE_KINDS:
        yield f"and {len(swept.failures) - MAX_FAILURE_KINDS} other kinds"
