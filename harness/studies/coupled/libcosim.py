"""Runs of an SSP archive with libcosim (package libcosimpy); its first row is after the first step."""

from collections.abc import Sequence

from ...errors import HarnessError
from ...running.ssp import ArchiveRun
from .system import ElementVariable

NANO = 1e9  # libcosim counts time in ns


def run_archive(run: ArchiveRun, variables: Sequence[ElementVariable], parameter_set: str) -> list[list[float]]:
    """Return the rows of a run; the parameter set is that of the archive."""
    count = round(run.stop / run.grid)
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(str(run.archive), round(run.grid * NANO))
    observer = CosimObserver.create_time_series(count + 1)
    execution.add_observer(observer)
    addresses = [(execution.slave_index_from_instance_name(element), reference) for element, _, reference in variables]
    for slave, reference in addresses:
        observer.start_time_series(slave, reference, CosimVariableType.REAL)
    if not execution.step(count):
        raise HarnessError("libcosim refuses a step")
    columns = [observer.time_series_real_samples(slave, reference, 1, count)[2] for slave, reference in addresses]
    return [list(row) for row in zip(*columns, strict=True)]
