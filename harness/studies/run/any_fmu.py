"""An FMU of any origin, run by its path; its outputs in a folder of results."""

from pathlib import Path
from typing import Any

from ...results.folder import replacing
from ...results.provenance import record
from ...running.any_fmu import own, run
from ...running.fmu import Report, simulate
from ...running.trajectory import Trajectory, of_run
from .job import FILES


def perform_run(
    path: Path, stop: float | None, tolerance: float, values: dict[str, Any], out: Path, report: Report
) -> tuple[Trajectory, Path]:
    """Run an FMU, and write its outputs to out/<name of the file>."""
    folder, wanted = out / path.stem, own(path, stop, values)
    with replacing(folder, FILES) as fresh:
        found = of_run(simulate(wanted, report)) if wanted else run(path, stop, tolerance, values, report)
        found.save(fresh / "trajectory.csv")
        record(fresh, [path], found.parameters, {"stop": stop, "tolerance": tolerance, "values": values})
    return found, folder
