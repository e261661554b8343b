"""decay: damping, dry friction and drag of a record or a scene."""

from functools import partial
from typing import Any

import click

from .terminal import POSITIVE, Terminal, result_options


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
@click.option("--time-unit", help="Unit of the time where the heading has none (s), as in ms, or 0.01s of samples.")
@click.option("--columns", "names", metavar="NAMES", help="Headings where the file has none: 't [s],x [mm]'.")
@click.option("--from", "begin", type=click.FLOAT, default=float("-inf"), help="Leave out what is before, in s.")
@click.option("--until", "end", type=click.FLOAT, default=float("inf"), help="Leave out what is after, in s.")
@click.option("--k", type=POSITIVE, help="Stiffness, N/m (N.m/rad): gives friction force.")
@click.option("--m", type=POSITIVE, help="Mass, kg (kg.m2), in place of k.")
@click.option("--pendulum", is_flag=True, help="The restoring torque is k sin(theta), k = m g a.")
@click.option("--drag/--no-drag", default=True, show_default=True, help="Try the laws with quadratic drag.")
@click.option("--drift", is_flag=True, help="Let the rest position (or the offset of a sensor) drift steadily.")
@result_options
def decay(
    source: str,
    velocity: str | None,
    k: float | None,
    m: float | None,
    pendulum: bool,
    drag: bool,
    drift: bool,
    terminal: Terminal,
    **columns: Any,
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
    from ..analyses.decay.estimates import KnownParameters
    from ..records.columns import ColumnOptions
    from ..studies.decay import study as decays
    from ..studies.decay.table import decay_table, summary_lines

    if k is not None and m is not None:
        raise click.UsageError("--k and --m: give one of them; the frequency tells the other")
    if velocity is not None:
        if columns["position"] is not None or columns["quantity"] not in (None, "velocity"):
            raise click.UsageError("--velocity: one column is fitted; leave out --position and --quantity")
        columns |= {"position": velocity, "quantity": "velocity"}
    asked, known = ColumnOptions(**columns), KnownParameters(k, m, pendulum)
    with decays.gc_paused(), terminal.progress(1) as report:
        progressed = partial(report, "standard input" if source == "-" else source)
        found, folder = decays.identify_decay(source, asked, known, drag, drift, terminal.out, progressed)
    terminal.print_result(
        decays.identified_as_json(found), decay_table(found), "", *summary_lines(found), folder=folder
    )
