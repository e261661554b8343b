"""Runs an SSP archive with libcosim (package libcosimpy), whose first values are those after the first step."""

from ...process.subprocess_runner import serve_request
from .engine import EngineRequest

NANO = 1e9  # libcosim counts time in whole ns


def run(asked: EngineRequest) -> list[list[float]]:
    """The rows of a run."""
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(asked.archive, round(asked.step * NANO))
    observer = CosimObserver.create_time_series(asked.count + 1)
    execution.add_observer(observer)
    places = [(execution.slave_index_from_instance_name(element), at) for element, _, at in asked.read]
    for place, at in places:
        observer.start_time_series(place, at, CosimVariableType.REAL)
    if not execution.step(asked.count):
        raise SystemExit("libcosim refuses a step")
    columns = [observer.time_series_real_samples(place, at, 1, asked.count)[2] for place, at in places]
    return [list(row) for row in zip(*columns, strict=True)]


if __name__ == "__main__":
    serve_request(EngineRequest, run)
