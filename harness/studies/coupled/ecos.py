"""Runs an SSP archive with Ecos (package ecospy; the library of the package tbb must be loaded first)."""

import ctypes
import sys
from pathlib import Path

from ...process.child_process import RequestServer
from .engine import EngineRequest


def run(request: EngineRequest) -> list[list[float]]:
    """Return the rows of a run."""
    if sys.platform == "linux":
        ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL)
    from ecospy import EcosLib, EcosSimulation

    EcosLib.set_log_level("warn")
    names = [f"{element}::{variable}" for element, variable, _ in request.read]
    with EcosSimulation(step_size=request.step, ssp_path=request.archive) as simulation:
        simulation.init(parameter_set=request.values or None)
        rows = [[simulation.get_real(name) for name in names]]
        for _ in range(request.count):
            simulation.step(1)
            rows.append([simulation.get_real(name) for name in names])
    return rows


if __name__ == "__main__":
    RequestServer().serve(lambda request: run(EngineRequest(**request)))
