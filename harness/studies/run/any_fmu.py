"""An FMU of any origin, run by its path; its outputs in a folder of results."""

from pathlib import Path
from typing import Any

from ...results.folder import replacing
from ...results.provenance import record
from ...running.any_fmu import run
from ...running.fmu import Report
from ...running.trajectory import Trajectory
from .job import FILES


def perform_run(
    path: Path, stop: float | None, tolerance: float, values: dict[str, Any], out: Path, report: Report
) -> tuple[Trajectory, Path]:
    """Run an FMU, and write its outputs to out/<name of the file>."""
    folder = out / path.stem
    with replacing(folder, FILES) as fresh:
        found = run(path, stop, tolerance, values, report)
        found.save(fresh / "trajectory.csv")
        record(fresh, [path], found.parameters, {"stop": stop, "tolerance": tolerance, "values": values})
    return found, folder
