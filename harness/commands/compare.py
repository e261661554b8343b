"""compare: how far two results or FMUs are apart."""

from functools import partial
from math import isnan
from pathlib import Path
from typing import Any

import click

from ..errors import HarnessError
from .terminal import Number, answer, anyones, progress, results


@click.command()
@click.argument("one", metavar="A")
@click.argument("two", metavar="B")
@anyones
@click.option("--within", type=Number(min=0), help="Exit status 1 if a relative difference is larger.")
@results
def compare(
    one: str,
    two: str,
    within: float | None,
    out: Path,
    quiet: bool,
    as_json: bool,
    **how: Any,
) -> None:
    """Show how far A and B are apart: FMUs of any origin (FMI 2.0, 3.0), scenes, result folders or CSV files.

    \b
    Examples:
      python -m harness compare results/stickslip results/stickslip-threshold
      python -m harness compare fmus/coulomb.fmu theirs.fmu --stop 2
      python -m harness compare results/smd measured.csv --within 1e-3
    """
    from ..running.specification import Specification
    from ..studies.compare import job

    with progress(quiet or as_json, 1) as report:
        asked = Specification(Path(), **how)
        found, folder = job.perform_compare((one, two), asked, out, partial(report, "compare"))
    shown = (job.table(found), "", *job.sentences(found), f"Results in {folder}")
    answer(quiet, as_json, job.numbers(found), *shown)
    failed = [each.failed for each in (found.one, found.two) if each.failed]
    if failed:
        raise HarnessError("\n".join(failed))
    if within is not None and not (found.worst <= within and (found.shift is None or found.shift == found.shift)):
        if isnan(found.worst):
            raise HarnessError(f"{one} or {two} holds what is not a finite number, which is in no bound")
        raise HarnessError(f"{one} and {two} differ by {found.worst:.3g} of the largest value, more than {within:g}")
