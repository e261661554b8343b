"""Runs an SSP archive with fmpy's reader, in a process of its own; JSON in and out, as of the other engines
(harness/studies/coupled/engine.py).

It reads the set of parameters only where it is told to, and shows no values before the first step.
"""

from typing import Any
from zipfile import ZipFile

from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv

from ..process.subprocess_runner import serve_request
from ..process.temporary_directory import temporary_directory


def run(archive: str, step: float, count: int, read: list[tuple[str, str, int]], values: str) -> list[list[float]]:
    """The rows of a run."""
    with temporary_directory("ssv-") as folder, ZipFile(archive) as content:
        name = "resources/parameters.ssv"
        parameters: Any = None
        if name in content.namelist():
            parameters = read_ssv(content.extract(name, folder))
        rows = simulate_ssp(archive, stop_time=(count - 0.5) * step, step_size=step, parameter_set=parameters)
    return [[float(row[f"{element}.{variable}"]) for element, variable, _ in read] for row in rows]


if __name__ == "__main__":
    serve_request(dict, lambda asked: run(**asked))
