"""A request carried out by Ecos (package ecospy, which needs the library of the package tbb in the process first)."""

import ctypes
import sys
from importlib.metadata import version
from pathlib import Path

from .request import Reply, Request, serve

if sys.platform == "linux":
    ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL)

from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure


def play(request: Request) -> Reply:
    EcosLib.set_log_level("warn")
    first = request.instances[0]
    with EcosSimulationStructure() as structure:
        for name in request.instances:
            structure.add_model(name, request.fmu)
        if request.connect:
            source, sink = request.connect
            structure.make_real_connection(f"{first}::{source}", f"{request.instances[1]}::{sink}")
        structure.add_parameter_set("values", {f"{first}::{name}": value for name, value in request.values.items()})
        with EcosSimulation(structure=structure, step_size=request.step) as simulation:
            rows = run(simulation, request, "values", request.change)
            again: list[list[float]] = []
            if request.again:
                simulation.reset()
                again = run(simulation, request, None, {})
            # Ecos does not look at the status of a step, so it accepts all.
            return Reply(version("ecospy"), rows, again, request.steps)


def run(
    simulation: EcosSimulation, request: Request, values: str | None, change: dict[str, float]
) -> list[list[float]]:
    """The rows of one run."""

    def row() -> list[float]:
        return [simulation.get_real(f"{instance}::{name}") for instance in request.instances for name in request.read]

    simulation.init(parameter_set=values)
    rows = [row()]
    for i in range(request.steps):
        if i == request.steps // 2:
            for name, value in change.items():
                simulation.set_real(f"{request.instances[0]}::{name}", value)
        simulation.step(1)
        rows.append(row())
    return rows


if __name__ == "__main__":
    serve(play)
