"""Adapter of Ecos (package ecospy; the library of the package tbb must be loaded first)."""

import ctypes
import sys
from importlib.metadata import version
from pathlib import Path

from .request import ImporterReply, ImporterRequest

if sys.platform == "linux":
    ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL)

from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure


def run_request(request: ImporterRequest) -> ImporterReply:
    EcosLib.set_log_level("warn")
    first = request.instances[0]
    with EcosSimulationStructure() as structure:
        for name in request.instances:
            structure.add_model(name, str(request.run.fmu))
        if request.connection:
            source, sink = request.connection
            structure.make_real_connection(f"{first}::{source}", f"{request.instances[1]}::{sink}")
        structure.add_parameter_set("values", {f"{first}::{name}": value for name, value in request.run.values.items()})
        with EcosSimulation(structure=structure, step_size=request.step) as simulation:
            rows = run(simulation, request, "values", request.midrun_changes)
            rerun: list[list[float]] = []
            if request.rerun:
                simulation.reset()
                rerun = run(simulation, request, None, {})
            # Ecos ignores the status of a step
            return ImporterReply(version("ecospy"), rows, rerun, request.steps)


def run(
    simulation: EcosSimulation, request: ImporterRequest, values: str | None, midrun_changes: dict[str, float]
) -> list[list[float]]:
    """Return the rows of one run."""

    def row() -> list[float]:
        return [
            simulation.get_real(f"{instance}::{name}") for instance in request.instances for name in request.run.outputs
        ]

    simulation.init(parameter_set=values)
    rows = [row()]
    for i in range(request.steps):
        if i == request.steps // 2:
            for name, value in midrun_changes.items():
                simulation.set_real(f"{request.instances[0]}::{name}", value)
        simulation.step(1)
        rows.append(row())
    return rows
