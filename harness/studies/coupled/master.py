"""Runs of an SSP archive with a fixed-step master of this project.

All components step at once with constant inputs; then the outputs are passed on. A component for model exchange is
integrated by fmpy's CVode from one communication point to the next.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from math import inf
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from ...errors import HarnessError
from ...process.temporary_directory import temporary_directory
from ...running.fmu_archive import unpack
from ...running.fmu_instance import CALL_FAILURES, FmuInstance, LogCapture
from ...running.model_exchange import ModelExchange
from ...running.ssp import ArchiveRun
from ...running.stepping import TimeGrid
from ...running.variable_values import REAL_TYPES, convert_value
from .system import Component, CoupledSystem, ElementVariable, Node, read_system

EXCHANGE_RTOL = 1e-10  # of components for model exchange


class Part:
    """Running component of a system.

    Parameters
    ----------
    component : Component
    folder : Path
        Directory of the unpacked FMU.
    grid : TimeGrid
        Communication points.
    """

    def __init__(self, component: Component, folder: Path, grid: TimeGrid) -> None:
        self.component, self.grid, self.log = component, grid, LogCapture()
        self.instance = FmuInstance(component.description, folder, component.exchange, log=self.log)
        self.inputs: dict[str, Any] = {}
        self.has_jump = False  # of an input since the last step
        self.stepper: ModelExchange | None = None

    def set(self, name: str, value: Any) -> None:
        """Set an input to a value of another component, which has its type or is converted to it."""
        variable = self.component.variables[name]
        if variable.type not in REAL_TYPES:
            value = bool(value) if variable.type == "Boolean" else int(value)
        self.has_jump = self.has_jump or self.inputs.get(name) != value
        self.inputs[name] = value
        if self.stepper is None:
            self.instance.set(variable, value)

    def start(self, t: float) -> None:
        """Begin stepping at t in s, after initialization."""
        if self.component.exchange:
            signals: Any = self  # sets the inputs of this part
            self.stepper = ModelExchange(self.instance, self.grid, EXCHANGE_RTOL, lambda: None, signals)
            self.stepper.start(t)

    def apply(self, t: float, continuous: bool = True, discrete: bool = True, after_event: bool = False) -> None:
        """Set all inputs, which are constant between communication points, as the solver of model exchange demands."""
        for name, value in self.inputs.items():
            self.instance.set(self.component.variables[name], value)

    def next_jump(self, t: float) -> float:
        return inf

    def step(self, t: float, target: float) -> None:
        """Step from t to a target in s."""
        if self.stepper is None:
            self.instance.step(t, target - t)
            return
        if self.has_jump:
            self.stepper.handle_event(t)
            self.has_jump = False
        while t < target:
            t = self.stepper.advance(t, target)
            if self.stepper.is_event:
                self.stepper.handle_event(t)


def run_archive(run: ArchiveRun, variables: Sequence[ElementVariable], parameter_set: str) -> list[list[float]]:
    """Return the rows of a run; all parameter sets of the archive are applied."""
    grid = TimeGrid(0.0, run.stop, run.grid)
    with ExitStack() as stack:
        folder = stack.enter_context(temporary_directory("ssp-"))
        with ZipFile(run.archive) as archive:
            archive.extractall(folder)
        system = read_system(folder)
        parts: dict[str, Part] = {}
        current = ""
        try:
            for current, component in system.components.items():
                parts[current] = Part(component, stack.enter_context(unpack(component.file)), grid)
                enter_initialization(parts[current], current, system, grid)
            for _ in range(len(parts) + 1):
                exchange_values(system, parts)
            for current, part in parts.items():  # noqa: B007
                part.instance.fmu.exitInitializationMode()
                part.start(grid.start)
            rows = [read_row(parts, variables)]
            for i in range(grid.count):
                t, target = grid.start if i == 0 else grid.point_at(i), grid.point_at(i + 1)
                for current, part in parts.items():  # noqa: B007
                    part.step(t, target)
                exchange_values(system, parts)
                rows.append(read_row(parts, variables))
            for part in parts.values():
                part.instance.close()
        except (*CALL_FAILURES, HarnessError) as error:
            message = parts[current].log.error_message if current in parts else ""
            raise HarnessError(f"{current}: {message or error}") from None
    return rows


def enter_initialization(part: Part, path: str, system: CoupledSystem, grid: TimeGrid) -> None:
    """Set the values of a component and enter its initialization."""
    variables = part.component.variables
    values = [
        (variables[name], convert_value(variables[name], value))
        for (owner, name), value in system.values.items()
        if owner == path
    ]
    part.instance.enter_initialization(values, grid.start, grid.stop)


def exchange_values(system: CoupledSystem, parts: dict[str, Part]) -> None:
    """Pass all outputs on to the inputs that they drive."""
    for link in system.links:
        value = get_value(parts, link.start)
        is_real = parts[link.end[0]].component.variables[link.end[1]].type in REAL_TYPES
        parts[link.end[0]].set(link.end[1], link.convert(float(value)) if is_real else value)


def get_value(parts: dict[str, Part], node: Node) -> Any:
    return parts[node[0]].instance.get(node[1])


def read_row(parts: dict[str, Part], variables: Sequence[ElementVariable]) -> list[float]:
    return [float(get_value(parts, (element, name))) for element, name, _ in variables]
