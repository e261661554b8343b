"""Repeated co-simulation runs of one FMU at given times, each in one call of a compiled loop.

The loop (whole_run.c) is compiled by the package ziglang or the system's compiler. Without either, the same calls are
made from Python, which takes about thirty times as long. The FMU is instantiated once and reset before each run.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from ctypes import CDLL, Structure, addressof, byref, c_double, c_int, c_size_t, c_uint32, c_void_p, cast
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from fmpy import fmi2, fmi3
from fmpy.fmi1 import FMICallException

from ..errors import HarnessError, first_line
from ..process.child_process import ChildError, ChildProcess
from ..process.subprocess_runner import run_subprocess
from ..process.temporary_directory import temporary_directory
from .c_host import COMPILER
from .description import REQUIRED_VARIABLES, read_description
from .fmu_session import capture_stderr, set_variable
from .unpacking import PROCESS_RESOURCES, unpack_once
from .variable_values import REAL_TYPES, effective_value, find_bound, variable_unit

SOURCE = Path(__file__).with_name("whole_run.c")
FUNCTIONS = {  # in the order of the structs in whole_run.c
    "2.0": ("SetReal", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode", "GetReal", "DoStep"),
    "3.0": ("SetFloat64", "EnterInitializationMode", "ExitInitializationMode", "GetFloat64", "DoStep"),
}
# without the runtime of the compiler, which would have to be built first
OPTIONS = ("-std=c99", "-O2", "-shared", "-fPIC", "-nostdlib", "-lc")
MAX_INPUTS = 64  # of whole_run.c
TIME_LIMIT = 10.0  # s of processor time of one run
STEPS_PER_CHECK = 16
MAX_PREPARED = 64
BUSY_TIME = 20.0  # s that a run in a child process may take beyond its processor time, on a busy machine


class FmuStruct(Structure):
    """The struct Fmu of whole_run.c."""

    _fields_ = (("fmi", c_int), ("functions", c_void_p), ("instance", c_void_p), ("limit", c_double))


class VariablesStruct(Structure):
    """The struct Variables of whole_run.c."""

    _fields_ = (("references", c_void_p), ("count", c_size_t), ("values", c_void_p))


@dataclass(frozen=True)
class RealVariable:
    """A scalar Real of an FMU. Start value and bounds are None if the FMU declares none."""

    reference: int
    causality: str
    variability: str
    start: float | None
    minimum: float | None
    maximum: float | None
    unit: str


@dataclass(frozen=True)
class RunRequest:
    """A run: values to set, communication points (n,) in s, outputs to read at every `stride`-th point, inputs (n,).

    The arrays of a request do not change: the structs of whole_run.c keep copies of them for runs with other values.
    """

    values: Mapping[str, float]
    t: np.ndarray
    outputs: Sequence[str]
    inputs: Mapping[str, np.ndarray]
    stride: int = 1


class RepeatedRun:
    """An instance of an FMU that is reset and run again and again.

    Parameters
    ----------
    fmu : pathlib.Path
    settings : mapping
        Values of enumerations, Integers, Booleans and Strings, which all runs share.
    limit : float
        Seconds of processor time that one run may take.
    """

    def __init__(self, fmu: Path, settings: Mapping[str, Any], limit: float) -> None:
        description = self.description = read_description(fmu)
        self.version, self.limit, self.loop = description.fmiVersion, limit, compile_loop()
        self.variables = real_variables(description)
        named = {variable.name: variable for variable in description.modelVariables}
        self.settings = [(named[name], value) for name, value in settings.items()]
        self.is_new = True
        self.prepared: dict[tuple[Any, ...], PreparedRun] = {}
        self.fmu = self.instantiate(fmu)
        names = FUNCTIONS[self.version]
        pointers = (cast(getattr(self.fmu.dll, f"fmi{self.version[0]}{name}"), c_void_p) for name in names)
        self.functions = (c_void_p * len(names))(*pointers)
        self.handle = FmuStruct(int(self.version[0]), cast(self.functions, c_void_p), self.fmu.component, limit)

    def instantiate(self, fmu: Path) -> Any:
        """Return a new instance that logs nothing: a refused set of values is not worth a message."""
        make = fmi2.FMU2Slave if self.version == "2.0" else fmi3.FMU3Slave
        try:
            instance = make(
                guid=self.description.guid or "",
                unzipDirectory=str(unpack_once(fmu)),
                modelIdentifier=self.description.coSimulation.modelIdentifier,
                instanceName=fmu.stem,
            )
            if self.version == "2.0":
                self.callbacks = fmi2.fmi2CallbackFunctions()
                logger = fmi2.fmi2CallbackLoggerTYPE
                self.callbacks.logger = (
                    cast(self.loop.ignore_message, logger) if self.loop else logger(lambda *message: None)
                )
                self.callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
                self.callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
                instance.instantiate(callbacks=self.callbacks)
            else:
                instance.instantiate(logMessage=lambda *message: None)
        except Exception as error:  # fmpy raises bare Exceptions
            raise HarnessError(f"{fmu.name} cannot be loaded: {first_line(error)}") from None
        return instance

    def run(self, request: RunRequest) -> np.ndarray | None:
        """Return the outputs (1 + (n - 1)//stride, outputs), or None if the FMU refuses the values or is too slow."""
        try:
            if not self.is_new:
                self.fmu.reset()
            self.is_new = False
            for variable, value in self.settings:
                set_variable(self.fmu, self.description, variable, value)
            return self.run_compiled(self.loop, request) if self.loop else self.run_in_python(request)
        except (FMICallException, RunTimeError):
            return None

    def run_compiled(self, loop: CDLL, request: RunRequest) -> np.ndarray:
        """Run the compiled loop; raise RunTimeError if it does not end well."""
        key = (tuple(request.values), id(request.t), tuple(map(id, request.inputs.values())), *request.outputs)
        prepared = self.prepared.get(key)
        if prepared is None or prepared.request.stride != request.stride:
            if len(self.prepared) >= MAX_PREPARED:
                self.prepared.clear()
            prepared = self.prepared[key] = PreparedRun(request, self.handle, self.variables)
        prepared.x[:-1] = [*request.values.values()]
        if loop.run(*prepared.arguments):
            raise RunTimeError
        return prepared.y.copy()

    def run_in_python(self, request: RunRequest) -> np.ndarray:
        """Make the calls of whole_run.c from Python."""
        y = np.empty(((len(request.t) - 1) // request.stride + 1, len(request.outputs)))
        fmu, t, begun = self.fmu, request.t.tolist(), process_time()
        is_fmi2 = self.version == "2.0"
        set_reals, get_reals = (fmu.setReal, fmu.getReal) if is_fmi2 else (fmu.setFloat64, fmu.getFloat64)
        inputs = [self.variables[name].reference for name in request.inputs]
        outputs = [self.variables[name].reference for name in request.outputs]
        u = np.stack([*request.inputs.values()], axis=1) if inputs else np.zeros((len(t), 0))
        held = (0.5 * (u[:-1] + u[1:])).tolist()
        set_reals([self.variables[name].reference for name in request.values], [*request.values.values()])
        if is_fmi2:
            fmu.setupExperiment(startTime=t[0], stopTime=t[-1])
        fmu.enterInitializationMode(**({} if is_fmi2 else {"startTime": t[0], "stopTime": t[-1]}))
        if inputs:
            set_reals(inputs, u[0].tolist())
        fmu.exitInitializationMode()
        y[0] = get_reals(outputs)
        for i in range(len(t) - 1):
            if inputs:
                set_reals(inputs, held[i])
            ended = fmu.doStep(t[i], t[i + 1] - t[i])
            if not is_fmi2 and (ended[1] or ended[2]):
                raise RunTimeError
            if (i + 1) % request.stride == 0:
                y[(i + 1) // request.stride] = get_reals(outputs)
            if i % STEPS_PER_CHECK == 0 and process_time() - begun > self.limit:
                raise RunTimeError
        if not np.isfinite(y).all():
            raise RunTimeError
        return y


class PreparedRun:
    """A request as whole_run.c receives it: for runs that differ in values only, all but the values stays.

    Attributes
    ----------
    x, y : numpy.ndarray
        Values to set, and one more; outputs (1 + (n - 1)//stride, outputs).
    arguments : tuple
        Arguments of the function `run` of whole_run.c.
    """

    def __init__(self, request: RunRequest, handle: FmuStruct, variables: Mapping[str, RealVariable]) -> None:
        self.request = request  # whose arrays must live on: their addresses identify this object
        self.x, self.t = np.zeros(len(request.values) + 1), np.ascontiguousarray(request.t, dtype=float)
        self.u = np.stack([*request.inputs.values()], axis=1).astype(float) if request.inputs else self.x
        self.y = np.empty(((len(self.t) - 1) // request.stride + 1, len(request.outputs)))
        self.structs = [
            make_struct(names, variables, array)
            for names, array in ((request.values, self.x), (request.inputs, self.u), (request.outputs, self.y))
        ]
        pointers = [byref(handle), *(byref(struct) for struct, _ in self.structs), c_void_p(self.t.ctypes.data)]
        self.arguments = (*pointers, c_size_t(len(self.t)), c_size_t(request.stride))


def make_struct(
    names: Iterable[str], variables: Mapping[str, RealVariable], array: np.ndarray
) -> tuple[VariablesStruct, Any]:
    """Return the struct of variables and their values, and the references, which must live as long."""
    references = [variables[name].reference for name in names]
    array_of_references = (c_uint32 * max(len(references), 1))(*references)
    return VariablesStruct(addressof(array_of_references), len(references), array.ctypes.data), array_of_references


class RunTimeError(Exception):
    """A run does not reach its end in time, the FMU terminates it, or outputs are not finite."""


class IsolatedRun:
    """Runs of an external FMU in a child process, which is replaced when it crashes or exceeds the time limit.

    Arrays are exchanged by files in `folder`.
    """

    def __init__(self, fmu: Path, settings: Mapping[str, Any], limit: float, folder: Path) -> None:
        self.process, self.folder = ChildProcess(f"{__package__}.whole_run_process"), folder
        self.instance = {"fmu": fmu, "settings": settings, "limit": limit}
        self.timeout = limit + BUSY_TIME
        self.files: dict[int, tuple[np.ndarray, Path]] = {}
        self.n_files = 0
        try:
            self.process.ask({**self.instance, "run": None}, self.timeout)
        except ChildError:
            raise HarnessError(f"{fmu.name} cannot be loaded: it crashes or hangs") from None

    def store(self, array: np.ndarray) -> Path:
        """Return the file of an array of a request, which is written once."""
        if id(array) not in self.files:
            if len(self.files) >= MAX_PREPARED:
                for _, path in self.files.values():
                    path.unlink()
                self.files.clear()
            path = self.folder / f"{self.n_files}.npy"
            np.save(path, array)
            self.files[id(array)] = array, path
            self.n_files += 1
        return self.files[id(array)][1]

    def run(self, request: RunRequest) -> np.ndarray | None:
        """Return the outputs, or None if the FMU refuses the values, crashes or is too slow."""
        inputs = {name: self.store(column) for name, column in request.inputs.items()}
        run = {**vars(request), "t": self.store(request.t), "inputs": inputs}
        try:
            results = self.process.ask({**self.instance, "run": run, "folder": self.folder}, self.timeout)
        except ChildError:
            return None
        return np.load(results) if results else None

    def close(self) -> None:
        """End the child process."""
        self.process.kill()


class Simulator:
    """Runs of one FMU with ever different values.

    Attributes
    ----------
    name : str
    variables : dict of RealVariable
        The scalar Reals of the FMU by name.
    n_runs : int
        Number of runs so far.
    """

    def __init__(self, name: str, variables: Mapping[str, RealVariable], runner: RepeatedRun | IsolatedRun) -> None:
        self.name, self.variables, self.runner, self.n_runs = name, variables, runner, 0

    def simulate(
        self,
        values: Mapping[str, float],
        t: np.ndarray,
        outputs: Sequence[str],
        inputs: Mapping[str, np.ndarray],
        stride: int = 1,
    ) -> np.ndarray | None:
        """Run from t[0] to t[-1].

        Parameters
        ----------
        values : mapping
            Parameters and start values.
        t : numpy.ndarray
            Communication points (n,) in s.
        outputs : sequence of str
        inputs : mapping
            Values (n,) of inputs at the communication points. Each step gets the mean of its two ends.
        stride : int
            Outputs are read at every `stride`-th point.

        Returns
        -------
        numpy.ndarray or None
            Outputs (1 + (n - 1)//stride, outputs); None if the FMU refuses the values, crashes or is too slow.
        """
        self.n_runs += 1
        return self.runner.run(RunRequest(values, t, outputs, inputs, stride))


@contextmanager
def open_simulator(fmu: Path, settings: Mapping[str, Any], limit: float = TIME_LIMIT) -> Iterator[Simulator]:
    """Instantiate an FMU for many runs; one that is not of this project runs in a child process.

    Parameters
    ----------
    fmu : pathlib.Path
    settings : mapping
        Values of enumerations, Integers, Booleans and Strings, which all runs share.
    limit : float
        Seconds of processor time that one run may take.

    Raises
    ------
    HarnessError
        If the FMU offers no co-simulation or cannot be loaded.
    """
    description = read_description(fmu)
    if description.coSimulation is None:
        raise HarnessError(f"{fmu.name} offers no co-simulation: export it for co-simulation")
    names = [variable.name for variable in description.modelVariables]
    runner: RepeatedRun | IsolatedRun
    with ExitStack() as stack:
        if all(name in names for name in REQUIRED_VARIABLES):
            stack.enter_context(capture_stderr())  # an FMU prints a sentence about each set that it refuses
            runner = RepeatedRun(fmu, settings, limit)
            stack.callback(runner.fmu.freeInstance)
        else:
            runner = IsolatedRun(fmu, settings, limit, stack.enter_context(temporary_directory("fit-")))
            stack.callback(runner.close)
        yield Simulator(fmu.stem, real_variables(description), runner)


def real_variables(description: Any) -> dict[str, RealVariable]:
    """Return the scalar Reals of an FMU by name."""
    return {
        variable.name: RealVariable(
            variable.valueReference,
            variable.causality,
            variable.variability,
            effective_value(variable, variable.start),
            find_bound(variable, "min"),
            find_bound(variable, "max"),
            variable_unit(variable),
        )
        for variable in description.modelVariables
        if variable.type in REAL_TYPES and not variable.dimensions
    }


@cache
def compile_loop() -> CDLL | None:
    """Return the compiled loop of runs, None if there is no compiler."""
    if find_spec("ziglang"):
        compiler = [sys.executable, "-m", "ziglang", "cc"]
    elif COMPILER:
        compiler = [COMPILER]
    else:
        return None
    library = PROCESS_RESOURCES.enter_context(temporary_directory("loop-")) / "whole_run.so"
    done = run_subprocess([*compiler, *OPTIONS, str(SOURCE), "-o", str(library)])
    return None if done.returncode else CDLL(str(library))
