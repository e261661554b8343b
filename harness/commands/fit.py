"""fit: parameters of any FMU from measured records."""

from functools import partial
from pathlib import Path
from typing import Any

import click

from .terminal import (
    BEGIN_OPTION,
    END_OPTION,
    HEADINGS_OPTION,
    POSITIVE,
    RATE_OPTION,
    SET_OPTION,
    TIME_OPTION,
    SectionedCommand,
    Terminal,
    result_options,
)


@click.command(cls=SectionedCommand)
@click.argument("model", metavar="MODEL|FMU")
@click.argument("records", metavar="FILE...", nargs=-1, required=True)
@click.option("--free", multiple=True, metavar="NAME[=LOW:HIGH],...", help="Parameters to fit, and ranges to search.")
@SET_OPTION
@click.option(
    "--observe",
    multiple=True,
    metavar="OUTPUT=COLUMN",
    help="Measured output and its column; repeatable. Default: a column named like an output.",
)
@click.option("--input", "inputs", multiple=True, metavar="INPUT=COLUMN", help="Input and its column; repeatable.")
@click.option(
    "--start",
    multiple=True,
    metavar="NAME=VALUE,...|RESULT",
    help="Values to start from, or the folder of an earlier fit; repeatable.",
)
@click.option("--each", metavar="NAME,...", help="Parameters that have a separate value for each record.")
@click.option("--sigma", multiple=True, metavar="OUTPUT=NOISE,...", help="Known noise, in the unit of the FMU.")
@click.option("--against", multiple=True, metavar="MODEL|FMU", help="Other law to fit and compare; repeatable.")
@click.option("--validate", multiple=True, metavar="FILE", help="Record to predict, not to fit; repeatable.")
@click.option("--robust", is_flag=True, help="Limit the effect of outliers.")
@TIME_OPTION
@HEADINGS_OPTION
@RATE_OPTION
@BEGIN_OPTION
@END_OPTION
@click.option(
    "--timeout", type=POSITIVE, default=10.0, show_default=True, help="Seconds of processor time for one run."
)
@result_options
def fit(
    model: str,
    records: tuple[str, ...],
    free: tuple[str, ...],
    values: tuple[str, ...],
    observe: tuple[str, ...],
    inputs: tuple[str, ...],
    start: tuple[str, ...],
    each: str | None,
    sigma: tuple[str, ...],
    against: tuple[str, ...],
    validate: tuple[str, ...],
    robust: bool,
    timeout: float,
    terminal: Terminal,
    **columns: Any,
) -> None:
    """Fit parameters of an FMU to measured records.

    MODEL is a model of this project or the path of an FMU for co-simulation.  The first sample of a FILE is the start
    of the run; the FMU's start values apply there and can be free.  Units in headings are converted to those of the
    FMU.  Without LOW:HIGH, a factor of 4 about the start value is searched; for a value of a table, up to
    4 times the largest one of the table.  offset(OUTPUT), gain(OUTPUT) and delay(OUTPUT) are unknowns of a sensor.

    --against fits other laws to the same records and compares all by the Bayesian information criterion.  Each FMU
    frees and fixes those of the given names that it has.

    The results are values with 95 % confidence intervals.  Parameters that the record does not determine are listed,
    with the combinations of them that it does determine.

    \b
    Examples:
      friction-fmus fit stickslip pull.csv --free mu_s,mu_d,k --observe x=laser
      friction-fmus fit coulomb shaker.csv --free m,k,f,c=0:5 --set x0=0
          --observe x=pos --input F_ext=force
      friction-fmus fit stickslip pull.csv --against sled.fmu
          --free k,mu_s,mu_d,f_s,f_d,v_s --observe x=laser
      friction-fmus fit sled.fmu a.csv b.csv --free f,v --each v --observe F=load
    """
    with terminal.progress(1) as report:  # the imports take most of a second
        from ..api import fit as fit_records
        from ..records.columns import ColumnOptions
        from ..results.provenance import describe_sources
        from ..results.result import save_result
        from ..scenes.assignments import parse_assignments
        from ..scenes.fmu_files import find_fmu
        from ..studies.fit import request as options
        from ..studies.fit.study import load_existing

        ranges, per_record = options.parse_ranges(free), options.split_list([each or ""])
        arguments: dict[str, Any] = {
            "free": ranges,
            "observe": options.parse_columns("--observe", observe),
            "inputs": options.parse_columns("--input", inputs),
            "values": parse_assignments("--set", values),
            "sigma": options.parse_numbers("--sigma", sigma),
            "start": options.parse_starts(start, ranges, per_record),
            "each": per_record,
            "robust": robust,
            "timeout": timeout,
        }
        fitted_records, validation_records = (
            [load_existing(file, ColumnOptions(**columns)) for file in group] for group in (records, validate)
        )
        compute = partial(
            fit_records,
            model,
            fitted_records,
            against=against,
            validate=validation_records,
            progress=partial(report, records[0]),
            **arguments,
        )
        folder = terminal.out / "fit" / fitted_records[0].name
        result = save_result(
            folder,
            compute,
            "fit",
            describe_sources(*records),
            files=[*map(find_fmu, (model, *against)), *(Path(file) for file in (*records, *validate) if file != "-")],
            parameters={name: (value, "") for name, value in arguments["values"].items()},
            scene=columns | arguments,
        )
    terminal.print_result(result.as_json(), *result.blocks(), folder=folder)
