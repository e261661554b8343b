"""Runs an SSP archive with libcosim (package libcosimpy), whose first values are those after the first step."""

from ...process.child import serve
from .engine import Request

NANO = 1e9  # libcosim counts time in whole ns


def run(asked: Request) -> list[list[float]]:
    """The rows of a run."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(asked.archive, round(asked.step * NANO))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    places = [(execution.slave_index_from_instance_name(element), at) for element, _, at in asked.read]
    rows = []
    for _ in range(asked.count):
        if not execution.step(1):
            raise SystemExit("libcosim refuses a step")
        rows.append([observer.last_real_values(place, [at])[0] for place, at in places])
    return rows


if __name__ == "__main__":
    serve(Request, run)
