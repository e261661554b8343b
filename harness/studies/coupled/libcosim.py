"""Runs an SSP archive with libcosim (package libcosimpy); the first row is that after the first step."""

from ...process.child_process import RequestServer
from .engine import EngineRequest

NANO = 1e9  # libcosim counts time in ns


def run(request: EngineRequest) -> list[list[float]]:
    """Return the rows of a run."""
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(request.archive, round(request.step * NANO))
    observer = CosimObserver.create_time_series(request.count + 1)
    execution.add_observer(observer)
    variables = [
        (execution.slave_index_from_instance_name(element), reference) for element, _, reference in request.read
    ]
    for slave, reference in variables:
        observer.start_time_series(slave, reference, CosimVariableType.REAL)
    if not execution.step(request.count):
        raise SystemExit("libcosim refuses a step")
    columns = [
        observer.time_series_real_samples(slave, reference, 1, request.count)[2] for slave, reference in variables
    ]
    return [list(row) for row in zip(*columns, strict=True)]


if __name__ == "__main__":
    RequestServer().serve(lambda request: run(EngineRequest(**request)))
