"""Runs of an SSP archive with Ecos (package ecospy, which needs the library of the package tbb)."""

import ctypes
import sys
from collections.abc import Sequence
from pathlib import Path

from ...scenes.run_spec import RunSpec
from .system import ElementVariable


def run_archive(run: RunSpec, variables: Sequence[ElementVariable], parameter_set: str) -> list[list[float]]:
    """Return the rows of a run."""
    assert run.stop is not None
    assert run.grid is not None
    if sys.platform == "linux":
        ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL)
    from ecospy import EcosLib, EcosSimulation

    EcosLib.set_log_level("warn")
    names = [f"{element}::{variable}" for element, variable, _ in variables]
    with EcosSimulation(step_size=run.grid, ssp_path=str(run.fmu)) as simulation:
        simulation.init(parameter_set=parameter_set or None)
        rows = [[simulation.get_real(name) for name in names]]
        for _ in range(round(run.stop / run.grid)):
            simulation.step(1)
            rows.append([simulation.get_real(name) for name in names])
    return rows
