"""Session of an external FMU in a worker process, and the trajectories of its runs."""

import json
import os
import signal
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from math import inf
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import fmpy
import numpy as np

from ...errors import MAX_VALUE_LENGTH, HarnessError, SceneError, check_names, option_text
from ...process.temporary_directory import temporary_directory
from ...process.worker import Worker, WorkerDiedError, WorkerTimeoutError
from ...scenes.run_spec import RunSpec
from ..event_mode import check_clocks
from ..fmu_archive import resolve_time_span, unpack
from ..recorder import Columns, ShapedVariable, array_shape, element_names, read_rows, select_variables
from ..session import QUIET
from ..stepping import check_inputs, check_rates
from ..trajectory import Trajectory
from ..variable_values import convert_value, effective_value, variable_unit
from .fmu_process import run_unpacked_fmu
from .step_refinement import (
    MAX_STEPS,
    ROWS_PREFIX,
    STRINGS_FILE,
    RefinementResult,
)

Values = dict[str, Any]  # by the name of the variable

GRACE_PERIOD = 0.5  # s beyond the timeout: a report is up to 0.2 s older than the call that follows it
SETTABLE = ("parameter", "structuralParameter", "input")


class ChildSession:
    """Runs of an external FMU that differ in values, in a worker process; a context manager, which ends the process.

    The FMU is unpacked once. A process whose run failed is replaced. An FMU that may be instantiated only once in a
    process has a new process for each run.

    Parameters
    ----------
    spec : RunSpec
        The run.
    description : ModelDescription
        Model description of the FMU.
    varied_names : sequence of str
        Variables whose values differ from run to run.
    """

    def __init__(self, spec: RunSpec, description: Any, varied_names: Sequence[str] = ()) -> None:
        self.spec, self.description, self.varied_names = spec, description, varied_names
        self.variables: Values = {variable.name: variable for variable in description.modelVariables}
        self.exchange = spec.exchange or description.coSimulation is None
        interface = description.modelExchange if self.exchange else description.coSimulation
        self.runs_once = interface is not None and interface.canBeInstantiatedOnlyOncePerProcess
        self.resources, self.worker = ExitStack(), Worker(memory_size())

    def __enter__(self) -> Self:
        self.resources.enter_context(self.worker)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.resources.close()

    @cached_property
    def folder(self) -> Path:
        """Return the directory of the unpacked FMU."""
        folder = self.resources.enter_context(unpack(self.spec.fmu))
        check_library(self.spec.fmu, self.description, self.exchange, folder)
        return folder

    def run(self, point: Sequence[Any] = (), report: Callable[[float], None] = QUIET) -> Trajectory:
        """Run with the values of the varied variables.

        Returns
        -------
        Trajectory
            If the run is incomplete, `failure` contains the reason.

        Raises
        ------
        SceneError
            If the specification names variables or values that the FMU does not have.
        HarnessError
            If there is no result at all.
        """
        spec = replace(self.spec, values={**self.spec.values, **dict(zip(self.varied_names, point, strict=True))})
        self.check_interface()
        values = convert_values(spec, self.variables)
        check_inputs(spec.inputs, self.variables, spec.values)
        check_rates(spec.fmu, spec.inputs, spec.values)
        selection = select_variables(spec, self.variables, values)
        start, stop = check_time_span(spec, self.description)
        report(0.0)
        inputs = {name: tuple(map(float, column)) for name, column in spec.inputs.items()}
        resolved_spec = replace(spec, exchange=self.exchange, start=start, stop=stop, values=values, inputs=inputs)
        with temporary_directory("rows-") as directory:
            outcome, output = self.call_worker(resolved_spec, directory, report)
            is_fmi2 = self.description.fmiVersion == "2.0"
            time, columns = read_longest_rows(directory, outcome.run_number, selection, is_fmi2)
            texts = [json.loads(line) for line in read_lines(directory / STRINGS_FILE)]
        failure = f"{spec.fmu.name}: {outcome.failure}" if outcome.failure else ""
        if failure and len(time) and " at t = " not in failure:
            failure += f", after t = {time[-1]:.9g} s"
        if len(time) < 2:
            raise HarnessError(failure or f"{spec.fmu.name} returns no values")
        note_on_output = f"it printed: {output[-1][:MAX_VALUE_LENGTH]}" if output else ""
        note = "; ".join(filter(None, (outcome.note, note_on_output)))
        trajectory = build_trajectory(spec, self.variables, values, selection, time, columns, texts)
        return replace(trajectory, note=note, failure=failure)

    def check_interface(self) -> None:
        """Check that the FMU offers the interface, and that its clocks can tick."""
        if self.exchange and self.description.modelExchange is None:
            interfaces = " and ".join(offered_interfaces(self.description)) or "no interface"
            problem = "neither co-simulation nor model exchange"
            if self.spec.exchange:
                problem = "model exchange is not among them"
            raise HarnessError(f"{self.spec.fmu.name} offers {interfaces}; {problem}")
        check_clocks(self.description, self.exchange, self.spec.lenient)

    def call_worker(
        self, spec: RunSpec, directory: Path, report: Callable[[float], None]
    ) -> tuple[RefinementResult, list[str]]:
        """Run the FMU in the worker; return its result, or the reason why there is none, and the lines of its output.

        The rows are written to files in `directory`.
        """
        try:
            timeout = spec.timeout + GRACE_PERIOD
            arguments = (run_unpacked_fmu, spec, self.folder, directory)
            result = self.worker.call(*arguments, timeout=timeout, report=report)
            if result.failure or self.runs_once:  # after a failure, the instance still exists
                self.worker.kill()
            return result, self.worker.messages.splitlines()
        except WorkerTimeoutError as error:
            message = f"a call did not return within {spec.timeout:g} s ({option_text('timeout')} sets the limit)"
            return RefinementResult(None, "", message), error.messages.splitlines()
        except WorkerDiedError as error:
            message = f"its binary exited with status {error.status}"
            if error.status < 0:
                message = f"its binary crashed ({signal.strsignal(-error.status)})"
            return RefinementResult(None, "", message), error.messages.splitlines()


def offered_interfaces(description: Any) -> list[str]:
    """Return the interfaces of an FMU without model exchange."""
    interfaces = {"co-simulation": description.coSimulation, "scheduled execution": description.scheduledExecution}
    return [name for name, interface in interfaces.items() if interface]


def check_time_span(spec: RunSpec, description: Any) -> tuple[float, float]:
    """Return start and stop in s; raise SceneError if they cannot be resolved by floating-point steps."""
    start, stop = resolve_time_span(spec, description)
    if not np.spacing(max(abs(start), abs(stop))) * MAX_STEPS <= stop - start < inf:
        interval = f"between start = {start!r} s and stop = {stop!r} s"
        raise SceneError(
            f"{spec.fmu.name}: {interval} there are too few floating-point times; choose another {option_text('stop')}"
        )
    return start, stop


def convert_values(spec: RunSpec, variables: Values) -> Values:
    """Convert the values to set; arrays become lists."""
    settable = [
        name
        for name, variable in variables.items()
        if variable.causality in SETTABLE
        or (variable.initial in ("exact", "approx") and variable.variability != "constant")
    ]
    check_names("variable to set", spec.values, settable)
    values: Values = {}
    for name in sorted(spec.values, key=lambda name: bool(variables[name].dimensions)):
        values[name] = convert_value(variables[name], spec.values[name], array_shape(variables[name], values))
    return values


def check_library(fmu: Path, description: Any, exchange: bool, folder: Path) -> None:
    """Check that the FMU has a binary for this platform."""
    identifier = (description.modelExchange if exchange else description.coSimulation).modelIdentifier
    platform = fmpy.platform if description.fmiVersion == "2.0" else fmpy.platform_tuple
    if (folder / "binaries" / platform / f"{identifier}{fmpy.sharedLibraryExtension}").is_file():
        return
    others = sorted(file.name for file in folder.glob("binaries/*"))
    available = f"it has {', '.join(others)}" if others else "it has no binaries at all"
    names = sorted(file.name for file in folder.glob(f"binaries/{platform}/*{fmpy.sharedLibraryExtension}"))
    if names:
        available = f"binaries/{platform} has {', '.join(names)}, and the name must be the modelIdentifier"
    sources = "; it contains C sources: `fmpy compile` may build a binary" if any(folder.glob("sources/*.c")) else ""
    raise HarnessError(f"{fmu.name} has no binary {platform}/{identifier} for this machine: {available}{sources}")


def memory_size() -> int:
    """Return the memory of this machine in bytes, 0 if the system does not state it: no FMU can use more."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 0


def read_longest_rows(
    directory: Path, run_number: int | None, selection: list[ShapedVariable], is_fmi2: bool
) -> tuple[np.ndarray, Columns]:
    """Return time and columns of the selected run; for None those of the longest run, which may be empty."""
    files = [directory / f"{ROWS_PREFIX}{run_number}"] if run_number is not None else directory.glob(f"{ROWS_PREFIX}*")
    runs = [read_rows(file.read_bytes(), selection, is_fmi2) for file in files]
    return max((run for run in runs if len(run[0])), key=lambda run: float(run[0][-1]), default=(np.zeros(0), {}))


def read_lines(path: Path) -> list[str]:
    """Return the lines of a file; none if it does not exist."""
    return path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []


def build_trajectory(
    spec: RunSpec,
    variables: Values,
    values: Values,
    selection: list[ShapedVariable],
    time: np.ndarray,
    recorded_columns: Columns,
    texts: list[str],
) -> Trajectory:
    """Build the trajectory of a run from the recorded columns."""
    columns, units, descriptions = {}, {}, {}
    for variable, shape in selection:
        for name in element_names(variable.name, shape):
            if name in spec.outputs or variable.name in spec.outputs:
                column = recorded_columns[name]
                columns[name] = np.array(texts)[column] if variable.type == "String" else column
                units[name], descriptions[name] = variable_unit(variable), variable.description or name
    parameters: Values = {}
    set_values = {alias_key(variables[name]): value for name, value in values.items()}
    for name, variable in variables.items():
        if variable.causality in SETTABLE or name in values:
            parameters[name], units[name] = (
                effective_value(variable, set_values.get(alias_key(variable), variable.start)),
                variable_unit(variable),
            )
    effective_values = {name: effective_value(variables[name], value) for name, value in values.items()}
    effective_spec = replace(spec, outputs=tuple(columns), values=effective_values)
    return Trajectory(time, columns, units, descriptions, spec=effective_spec, parameters=parameters)


def alias_key(variable: Any) -> tuple[str, int]:
    """Return type and value reference of a variable, which alias variables share."""
    kind = "Integer" if variable.type == "Enumeration" else variable.type
    return kind, variable.valueReference
