"""Runs of an SSP archive with Ecos (package ecospy, which needs the library of the package tbb)."""

import ctypes
import sys
from collections.abc import Sequence
from pathlib import Path

from ...running.ssp import ArchiveRun
from .system import ElementVariable


def run_archive(run: ArchiveRun, variables: Sequence[ElementVariable], parameter_set: str) -> list[list[float]]:
    """Return the rows of a run."""
    if sys.platform == "linux":
        ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL)
    from ecospy import EcosLib, EcosSimulation

    EcosLib.set_log_level("warn")
    names = [f"{element}::{variable}" for element, variable, _ in variables]
    with EcosSimulation(step_size=run.grid, ssp_path=str(run.archive)) as simulation:
        simulation.init(parameter_set=parameter_set or None)
        rows = [[simulation.get_real(name) for name in names]]
        for _ in range(round(run.stop / run.grid)):
            simulation.step(1)
            rows.append([simulation.get_real(name) for name in names])
    return rows
