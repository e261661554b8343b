"""curve: identify friction over velocity from points, or from a record over time."""

from functools import partial
from pathlib import Path
from typing import Any

import click

from .terminal import (
    BEGIN_OPTION,
    END_OPTION,
    FINITE,
    HEADINGS_OPTION,
    NONNEGATIVE,
    POSITIVE,
    RATE_OPTION,
    TIME_OPTION,
    SectionedCommand,
    Terminal,
    result_options,
)


@click.command(cls=SectionedCommand)
@click.argument("source", metavar="FILE|-")
@click.option("--velocity", help="Heading of the velocity. Default: v, speed, ..., or the first unit of a velocity.")
@click.option("--position", help="Heading of the position, in a record over time without a velocity.")
@click.option("--force", help="Heading of the force or torque. Default: F, torque, ..., or the first such unit.")
@click.option("--current", help="Heading of the current of the motor, instead of a force.")
@click.option("--constant", metavar="SIZE", help="Constant of the motor: '0.12 N.m/A' or '35 N/A'.")
@click.option("--points", is_flag=True, help="Take each row as a point, even if the file has times.")
@TIME_OPTION
@HEADINGS_OPTION
@RATE_OPTION
@BEGIN_OPTION
@END_OPTION
@click.option(
    "--mass",
    type=POSITIVE,
    help="Mass in kg, or moment of inertia in kg.m2, to remove inertia; stickslip needs it as well.",
)
@click.option("--bias", type=FINITE, help="Known constant force or gravity in N or N.m. Default: it is identified.")
@click.option(
    "--backlash",
    type=NONNEGATIVE,
    default=0.0,
    show_default=True,
    help="Distance in m or rad after a reversal to leave out of a record over time.",
)
@result_options
def curve(source: str, terminal: Terminal, **options: Any) -> None:
    """Identify friction over velocity from measured points in FILE, or from a record over time.

    A row of FILE is a point, a velocity and a force or torque.  With a column of times FILE is a record: plateaus of
    constant velocity become points, and without plateaus, samples of nearly the same velocity.  The laws are Coulomb,
    viscous, Tustin and Stribeck friction, equal in both directions or not.  A constant bias is removed.

    The results are the constants of each law with 95 % confidence intervals, the Bayesian information criterion (BIC)
    of each law, the points that do not fit, values for models, the curve as a table, and model files with the best law
    and with the table.

    \b
    Examples:
      points:           friction-fmus curve bench.csv --velocity "v [mm/s]" --force "F [N]"
      a motor:          friction-fmus curve axis.csv --velocity speed --current i --constant "0.12 N.m/A"
      a record:         friction-fmus curve slide.csv --time t --position x --force F --mass 2.5
      one direction:    friction-fmus curve brake.csv --bias 0
    """
    from ..api import identify_curve
    from ..records.columns import ColumnOptions
    from ..records.record import load_record
    from ..results.provenance import describe_sources
    from ..results.result import save_result

    columns = {name: options.pop(name) for name in ("time", "headings", "rate", "begin", "end")}
    record = load_record(source, ColumnOptions(**columns))
    folder, files = terminal.out / "curve" / record.name, () if source == "-" else (Path(source),)
    compute = partial(identify_curve, record, **options)
    result = save_result(folder, compute, "curve", describe_sources(source), files=files, scene=columns | options)
    terminal.print_result(result.as_json(), *result.blocks(), folder=folder)
