"""Runs an SSP archive with Ecos (package ecospy, which needs the library of the package tbb in the process first)."""

import ctypes
import sys
from pathlib import Path

from ...process.subprocess_runner import serve_request
from .engine import EngineRequest


def run(asked: EngineRequest) -> list[list[float]]:
    """The rows of a run."""
    if sys.platform == "linux":
        ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL)
    from ecospy import EcosLib, EcosSimulation

    EcosLib.set_log_level("warn")
    names = [f"{element}::{variable}" for element, variable, _ in asked.read]
    with EcosSimulation(step_size=asked.step, ssp_path=asked.archive) as simulation:
        simulation.init(parameter_set=asked.values or None)
        rows = [[simulation.get_real(name) for name in names]]
        for _ in range(asked.count):
            simulation.step(1)
            rows.append([simulation.get_real(name) for name in names])
    return rows


if __name__ == "__main__":
    serve_request(EngineRequest, run)
