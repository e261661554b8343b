"""Repeated co-simulation runs of one FMU at given times, each in one call of a compiled loop.

The loop (whole_run.c) is compiled by the package ziglang or the system's compiler. Without either, the same calls are
made from Python, which takes about thirty times as long. The FMU is instantiated once and reset before each run.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from ctypes import CDLL, Structure, addressof, byref, c_double, c_int, c_size_t, c_uint32, c_void_p, cast
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..process.child_process import ChildError, ChildProcess
from ..process.subprocess_runner import run_subprocess
from ..process.temporary_directory import temporary_directory
from ..scenes.run_spec import RunSpec
from .c_host import COMPILER
from .fmu_archive import PROCESS_RESOURCES, exposes_solver_steps, read_description, unpack_once
from .fmu_session import CALL_FAILURES, FmuSession, capture_stderr
from .variable_values import REAL_TYPES, effective_value, find_bound, variable_unit

SOURCE = Path(__file__).with_name("whole_run.c")
FUNCTIONS = {  # in the order of the structs in whole_run.c
    "2.0": ("SetReal", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode", "GetReal", "DoStep"),
    "3.0": ("SetFloat64", "EnterInitializationMode", "ExitInitializationMode", "GetFloat64", "DoStep"),
}
# without the runtime of the compiler, which would have to be built first
OPTIONS = ("-std=c99", "-O2", "-shared", "-fPIC", "-nostdlib", "-lc")
MAX_INPUTS = 64  # of whole_run.c
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

    causality: str
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
    """A session that is reset and run again and again.

    Parameters
    ----------
    shared : RunSpec
        The FMU, values of variables of any type, which all runs share, and the seconds of processor time that one run
        may take.
    """

    def __init__(self, shared: RunSpec) -> None:
        try:
            session = self.session = FmuSession(read_description(shared.fmu), unpack_once(shared.fmu))
        except HarnessError as error:
            raise HarnessError(f"{shared.fmu.name} cannot be loaded: {error}") from None
        self.limit, self.loop, self.is_new = shared.timeout, compile_loop(), True
        self.settings = [(session.variables[name], value) for name, value in shared.values.items()]
        self.prepared: dict[tuple[Any, ...], PreparedRun] = {}
        version = session.description.fmiVersion
        self.functions = (c_void_p * len(FUNCTIONS[version]))(
            *(cast(session.function(name), c_void_p) for name in FUNCTIONS[version])
        )
        self.handle = FmuStruct(int(version[0]), cast(self.functions, c_void_p), session.instance, self.limit)

    def run(self, request: RunRequest) -> np.ndarray | None:
        """Return the outputs (1 + (n - 1)//stride, outputs), or None if the FMU refuses the values or is too slow."""
        try:
            if not self.is_new:
                self.session.reset()
            self.is_new = False
            for variable, value in self.settings:
                self.session.set(variable, value)
            return self.run_compiled(self.loop, request) if self.loop else self.run_in_python(request)
        except (*CALL_FAILURES, RunTimeError):
            return None

    def run_compiled(self, loop: CDLL, request: RunRequest) -> np.ndarray:
        """Run the compiled loop; raise RunTimeError if it does not end well."""
        key = (tuple(request.values), id(request.t), tuple(map(id, request.inputs.values())), *request.outputs)
        prepared = self.prepared.get(key)
        if prepared is None or prepared.request.stride != request.stride:
            if len(self.prepared) >= MAX_PREPARED:
                self.prepared.clear()
            prepared = self.prepared[key] = PreparedRun(request, self.handle, self.session)
        prepared.x[:-1] = [*request.values.values()]
        if loop.run(*prepared.arguments):
            raise RunTimeError
        return prepared.y.copy()

    def run_in_python(self, request: RunRequest) -> np.ndarray:
        """Make the calls of whole_run.c from Python."""
        y = np.empty(((len(request.t) - 1) // request.stride + 1, len(request.outputs)))
        session, t, begun = self.session, request.t.tolist(), process_time()
        inputs = [session.variables[name] for name in request.inputs]
        u = np.stack([*request.inputs.values()], axis=1) if inputs else np.zeros((len(t), 0))
        held = (0.5 * (u[:-1] + u[1:])).tolist()
        values = [(session.variables[name], value) for name, value in request.values.items()]
        session.initialize([*values, *zip(inputs, u[0].tolist(), strict=True)], t[0], t[-1])
        y[0] = [session.get(name) for name in request.outputs]
        for i in range(len(t) - 1):
            for variable, value in zip(inputs, held[i], strict=True):
                session.set(variable, value)
            session.step(t[i], t[i + 1] - t[i])
            if (i + 1) % request.stride == 0:
                y[(i + 1) // request.stride] = [session.get(name) for name in request.outputs]
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

    def __init__(self, request: RunRequest, handle: FmuStruct, session: FmuSession) -> None:
        self.request = request  # whose arrays must live on: their addresses identify this object
        self.x, self.t = np.zeros(len(request.values) + 1), np.ascontiguousarray(request.t, dtype=float)
        self.u = np.stack([*request.inputs.values()], axis=1).astype(float) if request.inputs else self.x
        self.y = np.empty(((len(self.t) - 1) // request.stride + 1, len(request.outputs)))
        self.structs = [
            make_struct([session.variables[name].valueReference for name in names], array)
            for names, array in ((request.values, self.x), (request.inputs, self.u), (request.outputs, self.y))
        ]
        pointers = [byref(handle), *(byref(struct) for struct, _ in self.structs), c_void_p(self.t.ctypes.data)]
        self.arguments = (*pointers, c_size_t(len(self.t)), c_size_t(request.stride))


def make_struct(references: Sequence[int], array: np.ndarray) -> tuple[VariablesStruct, Any]:
    """Return the struct of variables and their values, and the references, which must live as long."""
    array_of_references = (c_uint32 * max(len(references), 1))(*references)
    return VariablesStruct(addressof(array_of_references), len(references), array.ctypes.data), array_of_references


class RunTimeError(Exception):
    """A run does not reach its end in time, or outputs are not finite."""


class IsolatedRun:
    """Runs of an external FMU in a child process, which is replaced when it crashes or exceeds the time limit.

    Arrays are exchanged by files in `folder`.
    """

    def __init__(self, shared: RunSpec, folder: Path) -> None:
        self.process, self.shared, self.folder = ChildProcess(f"{__package__}.whole_run_process"), shared, folder
        self.timeout = shared.timeout + BUSY_TIME
        self.files: dict[int, tuple[np.ndarray, Path]] = {}
        self.n_files = 0
        try:
            self.process.ask({"shared": shared, "run": None}, self.timeout)
        except ChildError:
            raise HarnessError(f"{shared.fmu.name} cannot be loaded: it crashes or hangs") from None

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
            results = self.process.ask({"shared": self.shared, "run": run, "folder": self.folder}, self.timeout)
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
def open_simulator(shared: RunSpec) -> Iterator[Simulator]:
    """Instantiate an FMU for many runs; one that is not of this project runs in a child process.

    Parameters
    ----------
    shared : RunSpec
        What all runs share: the FMU, values, and as `timeout` the seconds of processor time that one run may take.

    Raises
    ------
    HarnessError
        If the FMU offers no co-simulation or cannot be loaded.
    """
    fmu, description = shared.fmu, read_description(shared.fmu)
    if description.coSimulation is None:
        raise HarnessError(f"{fmu.name} offers no co-simulation: export it for co-simulation")
    runner: RepeatedRun | IsolatedRun
    with ExitStack() as stack:
        if exposes_solver_steps(description):
            stack.enter_context(capture_stderr())  # an FMU prints a sentence about each set that it refuses
            runner = RepeatedRun(shared)
            stack.callback(runner.session.close)
        else:
            runner = IsolatedRun(shared, stack.enter_context(temporary_directory("fit-")))
            stack.callback(runner.close)
        yield Simulator(fmu.stem, real_variables(description), runner)


def real_variables(description: Any) -> dict[str, RealVariable]:
    """Return the scalar Reals of an FMU by name."""
    return {
        variable.name: RealVariable(
            variable.causality,
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
