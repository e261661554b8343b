"""The numbers to reach, each beside what it is compared with in the same run."""

import csv
from collections.abc import Callable
from pathlib import Path

from ...results.folder import replacing
from ...truths.truth import check
from .measure import Measure

FOLDER, FILE = "bench", "bench.csv"


def measures() -> list[Callable[[], Measure]]:
    """All that is measured: run times, then those of the native FMUs, then errors."""
    check()
    from .accuracy import accuracy
    from .native import native
    from .speed import speed

    return [*speed(), *native(), *accuracy()]


def bench(chosen: list[Callable[[], Measure]], out: Path, report: Callable[[str, float], None]) -> list[Measure]:
    """Measure the chosen and write out/bench/bench.csv; told of each as it comes."""
    with replacing(out / FOLDER, (FILE,)) as folder:
        found = []
        for measure in chosen:
            found.append(measure())
            report(found[-1].what, 1.0)
        save(found, folder / FILE)
    return found


def save(found: list[Measure], path: Path) -> None:
    """One line for each measure and for each number beside it."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["what", "measured", "unit", "to reach", "reached", "beside", "its value"])
        for measure in found:
            mine = [measure.what, repr(measure.value), measure.unit, repr(measure.reach), measure.reached]
            for beside in measure.beside:
                writer.writerow([*mine, beside.name, "" if beside.value is None else repr(beside.value)])
