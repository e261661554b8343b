"""A certified result for any model: the default run of its FMU by two methods that share no formula, where they agree.

It lies beside the file of the model, under its name, and goes into the FMU when that is built next.
"""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..results.files import heading
from ..running.inside import Inside, embedded, offered
from .reference import POINTS, relative

METHODS = {"dop853": 1e-13, "rodas": 1e-12}  # an explicit one and one for stiff laws, with their relative tolerances
AGREED = 1e-9
PATIENCE = 120.0  # s, for each


@dataclass(frozen=True)
class Certified:
    """The file that was written, and the largest relative difference of the two."""

    path: Path
    difference: float


def certify(file: Path) -> Certified:
    """Write the result of the model in a file, whose FMU lies beside it; HarnessError where it cannot be certified."""
    fmu = file.with_suffix(".fmu")
    if not fmu.is_file():
        raise HarnessError(f"there is no {fmu}: build it with `python build_fmus.py {file}`")
    model: Any = embedded(fmu)
    if missing := METHODS.keys() - offered(model):
        raise HarnessError(f"{fmu} does not offer {', '.join(sorted(missing))}: build it with all of its methods")
    times = np.linspace(0.0, model.stop_time, POINTS)
    motions = []
    for method, rtol in METHODS.items():
        run = Inside.prepared(model, {}, method, rtol)
        motions.append(np.array(run.motion(times.tolist(), PATIENCE)))
    difference = float(relative(motions[1], motions[0]).max())
    first, second = METHODS
    if not difference <= AGREED:
        raise HarnessError(
            f"{file.name}: {first} and {second} differ by {difference:.1e}, more than {AGREED:g}, and nothing is "
            "certified: shorten the default run, or smooth a law that jumps"
        )
    path = file.with_suffix(".csv")
    with path.open("w", encoding="utf-8", newline="") as out:
        out.write(f"# {first} and {second}, relative difference {difference:.1e}\n")
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow([heading("t", "s"), *(heading(name, unit) for name, unit in states(model))])
        writer.writerows([t, *row] for t, row in zip(times.tolist(), motions[0].tolist(), strict=True))
    return Certified(path, difference)


def states(model: type) -> list[tuple[str, str]]:
    """Name and unit of each state that a solver integrates, in order."""
    declared = [one for cls in model.__mro__ for one in vars(cls).values() if getattr(one, "role", "") == "state"]
    return [(one.name, one.unit) for one in declared if not one.rate]
