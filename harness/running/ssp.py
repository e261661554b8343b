"""Runs of an SSP archive with fmpy; arguments and result as of the other co-simulation engines.

fmpy reads a parameter set only if it is passed explicitly, and records no values before the first step.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv

from ..process.temporary_directory import temporary_directory


@dataclass(frozen=True)
class ArchiveRun:
    """Run of an SSP archive from 0 to `stop` in steps of `grid`, in s; names of the variables to record."""

    archive: Path
    outputs: tuple[str, ...]
    stop: float
    grid: float


def run_archive(run: ArchiveRun, variables: Sequence[Any], parameter_set: str) -> list[list[float]]:
    """Run the archive and return one row per step."""
    stop = (round(run.stop / run.grid) - 0.5) * run.grid
    with temporary_directory("ssv-") as directory, ZipFile(run.archive) as content:
        name = "resources/parameters.ssv"
        parameters: Any = None
        if name in content.namelist():
            parameters = read_ssv(content.extract(name, directory))
        rows = simulate_ssp(str(run.archive), stop_time=stop, step_size=run.grid, parameter_set=parameters)
    return [[float(row[name]) for name in run.outputs] for row in rows]
