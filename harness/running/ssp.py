"""Runs an SSP archive with fmpy in a child process; JSON input and output as for the other co-simulation engines.

fmpy reads a parameter set only if it is passed explicitly, and records no values before the first step.
"""

from typing import Any
from zipfile import ZipFile

from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv

from ..process.child_process import RequestServer
from ..process.temporary_directory import temporary_directory


def run(archive: str, step: float, count: int, read: list[tuple[str, str, int]], values: str) -> list[list[float]]:
    """Run the archive and return one row per step."""
    with temporary_directory("ssv-") as directory, ZipFile(archive) as content:
        name = "resources/parameters.ssv"
        parameters: Any = None
        if name in content.namelist():
            parameters = read_ssv(content.extract(name, directory))
        rows = simulate_ssp(archive, stop_time=(count - 0.5) * step, step_size=step, parameter_set=parameters)
    return [[float(row[f"{element}.{variable}"]) for element, variable, _ in read] for row in rows]


if __name__ == "__main__":
    RequestServer().serve(lambda request: run(**request))
