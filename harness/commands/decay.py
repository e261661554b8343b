"""decay: identify damping, dry friction and drag from a record or a scene."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from os.path import exists
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..arguments import QUANTITIES
from ..errors import HarnessError, RunError, SceneError, format_value
from .terminal import (
    BEGIN_OPTION,
    END_OPTION,
    HEADINGS_OPTION,
    POSITIVE,
    RATE_OPTION,
    TIME_OPTION,
    SectionedCommand,
    Terminal,
    refuse_options,
    result_options,
)

if TYPE_CHECKING:
    from ..records.columns import ColumnOptions
    from ..records.record import Record
    from ..studies.run.result import RunResult

COLUMN_OPTIONS = (  # of records
    "time",
    "column",
    "quantity",
    "unit",
    "headings",
    "rate",
)


@click.command(cls=SectionedCommand)
@click.argument("source", metavar="FILE|SCENE|-")
@TIME_OPTION
@click.option("--column", help="Heading of the column to fit. Default: x, theta, ...")
@click.option(
    "--quantity",
    type=click.Choice(QUANTITIES),
    help="Measured quantity, if it does not follow from the unit (an angle is a position).",
)
@click.option("--unit", help="Unit of the column, if the heading has none: mm, deg/s, ..., or 0.36deg a count.")
@HEADINGS_OPTION
@RATE_OPTION
@BEGIN_OPTION
@END_OPTION
@click.option("--k", type=POSITIVE, help="Stiffness in N/m or N.m/rad; required for the friction force.")
@click.option("--mass", type=POSITIVE, help="Mass in kg, or moment of inertia in kg.m2; an alternative to --k.")
@click.option("--pendulum", is_flag=True, help="Fit a pendulum: the restoring torque is k sin(theta), with k = m g a.")
@click.option("--drag/--no-drag", default=True, show_default=True, help="Fit the models with quadratic drag as well.")
@click.option("--drift", is_flag=True, help="Fit a linear drift of the rest position or sensor offset.")
@result_options
@click.pass_context
def decay(
    context: click.Context,
    source: str,
    terminal: Terminal,
    **options: Any,
) -> None:
    """Identify damping, dry friction and drag from a measured decay in FILE, or from a run of SCENE.

    FILE is text with any delimiter, a spreadsheet (.xlsx, .ods), a .mat, HDF5, .npy, .npz, Parquet or JSON file, or a
    .zip archive with one table; - reads standard input.  Names and units are taken from headings such as "x [mm]" or
    "Gyroscope z (rad/s)"; the unit determines whether the column is a position, a velocity or an acceleration.  The
    record may start and end at any time; noise, uneven sampling, gaps and an offset are allowed.

    The results are zeta, r = f/k and b = q/m with 95 % confidence intervals.  Remarks point out doubtful results.  A
    record that is not the free decay of one oscillator is rejected.

    \b
    Examples:
      a phone on a spring:    friction-fmus decay "Raw Data.csv" --mass 0.35
      a spreadsheet:          friction-fmus decay swing.xlsx --column "laser (mm)" --k 157.9
      a pendulum's encoder:   friction-fmus decay swing.txt --pendulum --unit 0.36deg --headings t,count
      standard input:         zcat swing.gz | friction-fmus decay - --unit mm --begin 2.5
      a scene:                friction-fmus decay coulomb
    """
    from ..api import identify_decay
    from ..records.columns import ColumnOptions
    from ..records.record import Record
    from ..results.provenance import describe_sources
    from ..results.result import save_result
    from ..studies.decay.study import is_record_file

    columns = {name: options.pop(name) for name in (*COLUMN_OPTIONS, "begin", "end")}
    if not is_record_file(source):
        refuse_options(context, "on a scene, whose FMU declares names and units", *COLUMN_OPTIONS)
    if columns["rate"] is not None and columns["time"] is not None:
        raise click.UsageError("--rate replaces the times in the file: omit --time")
    with pause_gc(), terminal.progress(1) as report:
        progress = partial(report, "standard input" if source == "-" else source)
        record = load_source(source, ColumnOptions(**columns), progress)
        if isinstance(record, Record):
            origin: dict[str, Any] = {"files": () if source == "-" else (Path(source),)}
        else:
            options |= {"begin": columns["begin"], "end": columns["end"]}
            origin = record._origin()
        folder = terminal.out / "decay" / record.name
        compute = partial(identify_decay, record, **options, progress=progress)
        origin |= {"source": describe_sources(source), "scene": columns | options}
        result = save_result(folder, compute, "decay", **origin)
    terminal.print_result(result.as_json(), *result.blocks(), folder=folder)


def load_source(source: str, columns: "ColumnOptions", report: Callable[[float], None]) -> "Record | RunResult":
    """Return the record in a file, or the run of a scene.

    Raises
    ------
    HarnessError
        If there is no such source, or the run fails or its position has no unit.
    """
    from ..api import simulate
    from ..records.record import load_record
    from ..scenes.scene import load_scene
    from ..simulation.resolve import prefer_scene
    from ..studies.decay.study import is_record_file

    if is_record_file(source):
        if source != "-" and not exists(source):
            raise SceneError(f"{format_value(source)} does not exist: give an existing record, or a scene")
        return load_record(source, columns)
    if Path(source).is_dir():
        raise SceneError(f"{source} is a folder; give a file in it")
    scene = load_scene(source)
    position = scene.run.motion_outputs.get("position", "")
    if not position:
        raise SceneError(f"scene {scene.name}: a decay needs the position among the outputs")
    try:
        run = simulate(prefer_scene(source), progress=report)
    except RunError as error:
        raise HarnessError(f"scene {scene.name}: {error}") from None
    if not run.units[position]:
        raise SceneError(
            f"scene {scene.name}: {position} has no unit in {scene.run.fmu.name}: run the scene, and identify the "
            "decay in its trajectory.csv with --unit"
        )
    return replace(run, label=scene.name)


@contextmanager
def pause_gc() -> Iterator[None]:
    """Pause garbage collection of cycles in the block; it takes a quarter of the run time of a short command."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
