"""Co-simulation runs of one FMU that differ in values only, each in one call of a compiled loop.

The loop (whole_run.c) is compiled by the package ziglang or the system's compiler. Without either, the same calls are
made from Python, which takes about thirty times as long. The FMU is instantiated once and reset before each run.
Inputs are linear within a step if the FMU interpolates inputs, otherwise they have their mean.
"""

import pickle
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from ctypes import CDLL, Structure, addressof, byref, c_double, c_int, c_size_t, c_void_p, cast
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..process.subprocess_runner import run_subprocess
from ..process.temporary_directory import temporary_directory
from ..process.worker import Worker, WorkerError
from ..scenes.run_spec import RunSpec
from .fmu_archive import (
    PROCESS_RESOURCES,
    exposes_solver_steps,
    read_description,
    resolve_time_span,
    unpack_once,
)
from .fmu_instance import CALL_FAILURES, FmuInstance, capture_stderr
from .model_data import read_model_data
from .stepping import TIME, check_rates, make_grid, ramps_of_steps, values_of_steps
from .variable_values import REAL_TYPES, effective_value, find_bound, variable_unit

SOURCE = Path(__file__).with_name("whole_run.c")
COMPILER = shutil.which("cc") or shutil.which("gcc")  # the compiler of the system
FUNCTIONS = {  # in the order of the structs in whole_run.c
    "2.0": (
        "SetReal",
        "SetupExperiment",
        "EnterInitializationMode",
        "ExitInitializationMode",
        "GetReal",
        "DoStep",
        "SetRealInputDerivatives",
    ),
    "3.0": ("SetFloat64", "EnterInitializationMode", "ExitInitializationMode", "GetFloat64", "DoStep"),
}
# without the runtime of the compiler, which would have to be built first, and without fused operations, which not all
# processors have
OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-nostdlib", "-lc", "-lm")
STEPS_PER_CHECK = 16
MAX_PREPARED = 64  # runs in the cache of a worker process
BUSY_TIME = 20.0  # s that a run in a worker process may take beyond its processor time, on a busy machine


class FmuStruct(Structure):
    """The struct Fmu of whole_run.c."""

    _fields_ = (("fmi", c_int), ("functions", c_void_p), ("instance", c_void_p), ("limit", c_double))


class VariablesStruct(Structure):
    """The struct Variables of whole_run.c."""

    _fields_ = (("references", c_void_p), ("count", c_size_t), ("values", c_void_p))


Run = Callable[[Mapping[str, float]], np.ndarray | None]  # outputs of a run with values; None if the FMU refuses them


@dataclass(frozen=True)
class RealVariable:
    """A scalar Real of an FMU. Start value and bounds are None if the FMU declares none."""

    causality: str
    variability: str
    start: float | None
    minimum: float | None
    maximum: float | None
    unit: str


class CompiledLoop:
    """Arguments of whole_run.c for runs that differ in Reals only, and the runs.

    Parameters
    ----------
    spec : RunSpec
        Specification of the runs, which must not follow the steps of the solver.
    simulator : Simulator
        Its instance does the runs.

    Attributes
    ----------
    t : numpy.ndarray
        Communication points (n,) in s.
    is_recorded : numpy.ndarray
        Whether the outputs are read at each point (n,).
    u : numpy.ndarray
        Inputs (n, inputs) at the start, and of each step: its mean, or the value at its start.
    slopes : numpy.ndarray or None
        Slopes (n, inputs) of the inputs in each step; None if they are constant.
    y : numpy.ndarray
        Outputs (recorded points, outputs).
    """

    def __init__(self, spec: RunSpec, simulator: "Simulator") -> None:
        assert not spec.follow
        self.simulator, self.instance = simulator, simulator.instance
        self.settings = [(self.instance.variables[name], value) for name, value in spec.values.items()]
        start, stop = resolve_time_span(spec, simulator.description)
        grid = make_grid(spec, start, stop)
        self.t = grid.points
        self.is_recorded = np.full(len(self.t), len(spec.times) in (0, len(self.t)))
        if not self.is_recorded[0]:
            self.is_recorded[np.searchsorted(self.t, np.asarray(spec.times, dtype=float) - grid.tolerance)] = True
        self.slopes: np.ndarray | None = None
        if simulator.interpolates_inputs and spec.inputs:
            self.u, self.slopes = ramps_of_steps(spec.inputs, self.t)
        else:
            check_rates(simulator.spec.fmu, spec.inputs, spec.values)
            self.u = values_of_steps(spec.inputs, self.t, read_model_data(simulator.spec.fmu).rate_inputs)
        self.y = np.empty((np.count_nonzero(self.is_recorded), len(spec.outputs)))
        self.outputs, self.inputs = spec.outputs, tuple(name for name in spec.inputs if name != TIME)
        self.names: tuple[str, ...] | None = None

    def name_values(self, names: tuple[str, ...]) -> None:
        """Prepare the arguments for values of these variables."""
        self.names, self.x = names, np.empty(len(names))
        groups = (names, self.x), (self.inputs, self.u), (self.outputs, self.y)
        self.structs = [self.simulator.make_struct(group, array) for group, array in groups]
        pointers = [byref(self.simulator.handle), *map(byref, self.structs)]
        arrays = [c_void_p(array.ctypes.data) for array in (self.t, self.is_recorded)]
        self.orders = (c_int * len(self.inputs))(*[1] * len(self.inputs))
        slopes = None if self.slopes is None else self.slopes.ctypes.data
        self.arguments = (*pointers, *arrays, c_size_t(len(self.t)), self.orders, c_void_p(slopes))

    def run(self, values: Mapping[str, float]) -> np.ndarray | None:
        """Return the outputs (recorded points, outputs); None if the FMU refuses the values or is too slow."""
        if tuple(values) != self.names:
            self.name_values(tuple(values))
        self.x[:] = [*values.values()]
        try:
            self.instance.restart()
            for variable, value in self.settings:
                self.instance.set(variable, value)
            if self.simulator.loop is None:
                self.run_in_python()
            elif self.simulator.loop.run(*self.arguments):
                return None
        except (*CALL_FAILURES, RunTimeError):
            return None
        return self.y.copy()

    def run_in_python(self) -> None:
        """Make the calls of whole_run.c from Python; raise RunTimeError if it would return FAILED or TOO_SLOW."""
        instance, t, start_time = self.instance, self.t.tolist(), process_time()
        inputs = [instance.variables[name] for name in self.inputs]
        assert self.names is not None
        start = [*zip(self.names, self.x.tolist(), strict=True), *zip(self.inputs, self.u[0].tolist(), strict=True)]
        instance.initialize([(instance.variables[name], value) for name, value in start], t[0], t[-1])
        rows = iter(self.y)
        for i in range(len(t)):
            if i:
                for variable, value in zip(inputs, self.u[i].tolist(), strict=True):
                    instance.set(variable, value)
                if self.slopes is not None:
                    references = [variable.valueReference for variable in inputs]
                    instance.fmu.setRealInputDerivatives(references, [1] * len(inputs), self.slopes[i].tolist())
                instance.step(t[i - 1], t[i] - t[i - 1])
            if self.is_recorded[i]:
                next(rows)[:] = [instance.get(name) for name in self.outputs]
            if i % STEPS_PER_CHECK == 0 and process_time() - start_time > self.simulator.spec.timeout:
                raise RunTimeError
        if not np.isfinite(self.y).all():
            raise RunTimeError


class RunTimeError(Exception):
    """A run exceeds its time limit, or outputs are not finite."""


class Simulator:
    """Runs of one FMU in this process, each in one call of the compiled loop.

    Parameters
    ----------
    spec : RunSpec
        Settings that all runs share: the FMU, values of variables of any type, and as `timeout` the seconds of
        processor time that one run may take.

    Attributes
    ----------
    variables : dict of RealVariable
        The scalar Reals of the FMU by name.
    n_runs : int
        Number of runs up to now.
    """

    def __init__(self, spec: RunSpec) -> None:
        self.spec, self.n_runs = spec, 0
        self.description = read_description(spec.fmu)
        self.variables = real_variables(self.description)
        self.load()

    def load(self) -> None:
        """Instantiate the FMU, and prepare the calls of the loop."""
        try:
            instance = self.instance = FmuInstance(self.description, unpack_once(self.spec.fmu))
        except HarnessError as error:
            raise HarnessError(f"{self.spec.fmu.name} cannot be loaded: {error}") from None
        version, cosimulation = self.description.fmiVersion, self.description.coSimulation
        self.loop = compile_library(SOURCE)
        self.interpolates_inputs = version == "2.0" and cosimulation.canInterpolateInputs
        self.functions = (c_void_p * len(FUNCTIONS[version]))(
            *(cast(instance.function(name), c_void_p) for name in FUNCTIONS[version])
        )
        self.references: dict[tuple[str, ...], Any] = {}
        functions = cast(self.functions, c_void_p)
        self.handle = FmuStruct(int(version[0]), functions, instance.component, self.spec.timeout)

    def prepare(self, spec: RunSpec) -> Run:
        """Return a function that runs a specification with other values of Reals.

        Parameters
        ----------
        spec : RunSpec
            Specification of the simulator with other outputs, inputs or times.

        Returns
        -------
        callable
            Receives values by name. Returns the outputs (times, outputs), at all communication points if there are no
            `times`; None if the FMU refuses the values, crashes or is too slow.
        """
        run = self.prepare_run(spec)

        def run_values(values: Mapping[str, float]) -> np.ndarray | None:
            self.n_runs += 1
            return run(values)

        return run_values

    def prepare_run(self, spec: RunSpec) -> Run:
        """Prepare runs that differ in Reals only."""
        return CompiledLoop(spec, self).run

    def make_struct(self, names: tuple[str, ...], values: np.ndarray) -> VariablesStruct:
        """Return the struct of variables and their values; the value references are cached."""
        if names not in self.references:
            self.references[names] = self.instance.make_references([self.instance.variables[name] for name in names])
        return VariablesStruct(addressof(self.references[names]), len(names), values.ctypes.data)

    def close(self) -> None:
        """Free the instance."""
        self.instance.close()


class ChildSimulator(Simulator):
    """Runs of an external FMU in a worker process, which is replaced when it crashes or exceeds the time limit."""

    def load(self) -> None:
        self.worker, self.timeout = Worker(), self.spec.timeout + BUSY_TIME
        try:
            self.worker.call(load_simulator, self.spec.fmu, self.spec.timeout, timeout=self.timeout)
        except BaseException as error:
            self.close()
            if isinstance(error, WorkerError):
                raise HarnessError(f"{self.spec.fmu.name} cannot be loaded: it crashes or hangs") from None
            raise

    def prepare_run(self, spec: RunSpec) -> Run:
        pickled_spec = pickle.dumps(spec)

        def run(values: Mapping[str, float]) -> np.ndarray | None:
            try:
                y: np.ndarray | None = self.worker.call(
                    run_pickled_spec, pickled_spec, dict(values), timeout=self.timeout
                )
            except WorkerError:
                return None
            return y

        return run

    def close(self) -> None:
        """End the process."""
        self.worker.kill()


@cache
def get_simulator(fmu: Path, limit: float) -> Simulator:
    """Return the simulator of an FMU, with a limit of the processor time of a run in s."""
    return Simulator(RunSpec(fmu, timeout=limit))


def load_simulator(fmu: Path, limit: float) -> None:
    """Load an FMU."""
    get_simulator(fmu, limit)


@lru_cache(MAX_PREPARED)
def prepare_pickled_spec(pickled_spec: bytes) -> "CompiledLoop":
    """Return the runs of a specification, which is compared by its bytes."""
    spec = pickle.loads(pickled_spec)
    return CompiledLoop(spec, get_simulator(spec.fmu, spec.timeout))


def run_pickled_spec(pickled_spec: bytes, values: dict[str, float]) -> np.ndarray | None:
    """Run a specification with other values, and return the outputs; None if there are none."""
    return prepare_pickled_spec(pickled_spec).run(values)


@contextmanager
def open_simulator(spec: RunSpec) -> Iterator[Simulator]:
    """Instantiate an FMU for many runs; one that is not of this project runs in a worker process.

    Raises
    ------
    HarnessError
        If the FMU offers no co-simulation or cannot be loaded.
    """
    description = read_description(spec.fmu)
    if description.coSimulation is None:
        raise HarnessError(f"{spec.fmu.name} offers no co-simulation: export it for co-simulation")
    with ExitStack() as stack:
        is_own = exposes_solver_steps(description)
        if is_own:
            stack.enter_context(capture_stderr())  # an FMU prints a sentence about each set that it refuses
        simulator = Simulator(spec) if is_own else ChildSimulator(spec)
        stack.callback(simulator.close)
        yield simulator


def real_variables(description: Any) -> dict[str, RealVariable]:
    """Return the scalar Reals of an FMU by name."""
    return {
        variable.name: RealVariable(
            variable.causality,
            variable.variability or "",
            effective_value(variable, variable.start),
            find_bound(variable, "min"),
            find_bound(variable, "max"),
            variable_unit(variable),
        )
        for variable in description.modelVariables
        if variable.type in REAL_TYPES and not variable.dimensions
    }


@cache
def compile_library(source: Path) -> CDLL | None:
    """Return the library of a C file, None if there is no compiler."""
    if find_spec("ziglang"):
        compiler = [sys.executable, "-m", "ziglang", "cc"]
    elif COMPILER:
        compiler = [COMPILER]
    else:
        return None
    library = PROCESS_RESOURCES.enter_context(temporary_directory("loop-")) / f"{source.stem}.so"
    compilation = run_subprocess([*compiler, *OPTIONS, str(source), "-o", str(library)])
    return None if compilation.returncode else CDLL(str(library))
