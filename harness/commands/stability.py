"""stability: stiff and extreme scenes."""

from pathlib import Path

import click

from ..errors import HarnessError
from .terminal import JSON, OUT, QUIET, progress, screen, tell


@click.command()
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
    from ..studies.stability import table as tables
    from ..studies.stability.study import FOLDER, all_cases, survey

    chosen = all_cases()
    with progress(quiet or as_json, sum(map(len, chosen))) as report:
        rows, regions = survey(out, report, chosen)
    if as_json:
        tell([{"scene": row.case.label, "well": row.well, "ended": row.ended} for row in rows])
    elif not quiet:
        screen().print(tables.endings(rows), "", tables.refusals(rows), "")
        screen().print(tables.summary(rows, regions), f"Results in {out / FOLDER}", sep="\n", highlight=False)
    wrong = [f"{row.case.label}: {row.text}" for row in rows if not row.well]
    if wrong:
        raise HarnessError("\n".join(wrong))
