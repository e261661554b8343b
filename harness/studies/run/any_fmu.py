"""An FMU of any origin, run by its path; its outputs in a folder of results."""

from pathlib import Path

from ...results.folder import replacing
from ...results.provenance import named, record
from ...running.any_fmu import run
from ...running.fmu import Report
from ...running.specification import Specification
from ...running.trajectory import Trajectory, of_run
from ...scenes.scene import usual
from .job import FILES


def perform_run(wanted: Specification, out: Path, report: Report) -> tuple[Trajectory, Path]:
    """Run an FMU, and write its outputs to out/<name of the file>."""
    from .figure import draw

    folder, source = out / wanted.model, named(str(wanted.fmu))
    with replacing(folder, FILES, source) as fresh:
        done = run(wanted, report)
        found = of_run(done)
        found.save(fresh / FILES[0])
        draw(wanted.fmu.name, usual(tuple(found.columns)), done, {}, fresh / "figure.svg")
        record(fresh, [wanted.fmu], found.parameters, wanted, source=source)
    return found, folder
