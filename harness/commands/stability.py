"""stability: stiff and extreme scenes."""

from pathlib import Path

import click

from ..errors import HarnessError
from .terminal import answer, progress, results


@click.command()
@results
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
    told = [{"scene": row.case.label, "well": row.well, "ended": row.ended} for row in rows]
    shown = (tables.endings(rows), "", tables.refusals(rows), "", tables.summary(rows, regions))
    answer(quiet, as_json, told, *shown, f"Results in {out / FOLDER}")
    wrong = [f"{row.case.label}: {row.text}" for row in rows if not row.well]
    if wrong:
        raise HarnessError("\n".join(wrong))
