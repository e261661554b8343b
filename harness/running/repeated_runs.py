"""Repeated runs of one instance of an FMU of this project, each with other values.

A run by closed form takes 40 microseconds, as long as a few calls through fmpy. So the library is called directly, with
buffers that are allocated and functions that are looked up once.
"""

from collections.abc import Iterable, Sequence
from ctypes import c_double, c_int, c_void_p
from typing import Any

from fmpy.fmi1 import FMICallException

from .fmi2 import WARNING, RunPlan, build_trajectory, make_buffer, record_run
from .settings import resolve_settings
from .trajectory import Trajectory

LibraryCall = tuple[str, Any, tuple[Any, ...]]  # name, function and arguments


class RepeatedRuns:
    """Runs of one instance, from start to stop.

    Parameters
    ----------
    plan : RunPlan
        What all runs share.
    fmu : fmpy.fmi2.FMU2Slave
        The instance.
    varied : sequence of str
        Variables whose values differ.
    reals, integers : sequence of str
        Variables to read at the end of a run.
    """

    def __init__(
        self, plan: RunPlan, fmu: Any, varied: Sequence[str], reals: Sequence[str], integers: Sequence[str]
    ) -> None:
        self.plan, self.fmu, self.component = plan, fmu, c_void_p(fmu.component)
        n_reals, real_references, self.reals = make_buffer(plan.variables, [*reals], c_double)
        n_integers, integer_references, self.integers = make_buffer(plan.variables, [*integers], c_int)
        self.slots: list[tuple[Any, int, type]] = []  # buffer, index and type of each varied value
        self.start_calls = self.prepare_start(varied)
        self.step_calls = [self.prepare("fmi2DoStep", plan.start, plan.stop - plan.start, 1)]
        self.read_calls = [
            self.prepare("fmi2GetReal", real_references, n_reals, self.reals),
            self.prepare("fmi2GetInteger", integer_references, n_integers, self.integers),
        ]

    def prepare(self, name: str, *arguments: Any) -> LibraryCall:
        """Return a call of the library."""
        return name, getattr(self.fmu.dll, name), (self.component, *arguments)

    def prepare_start(self, varied: Sequence[str]) -> list[LibraryCall]:
        """Return the calls that reset, set and initialize the instance."""
        plan, slots = self.plan, {}
        values = {variable.name: value for variable, value in resolve_settings(plan.spec, plan.variables)}
        calls = [self.prepare("fmi2Reset")]
        for function, kind, number in (("fmi2SetReal", c_double, float), ("fmi2SetInteger", c_int, int)):
            names = [name for name in (*values, *varied) if (plan.variables[name].type == "Real") is (number is float)]
            n, references, buffer = make_buffer(plan.variables, names, kind)
            for i, name in enumerate(names):
                buffer[i], slots[name] = values.get(name, 0), (buffer, i, number)
            calls += [self.prepare(function, references, n, buffer)] if n else []
        self.slots = [slots[name] for name in varied]
        calls.append(self.prepare("fmi2SetupExperiment", 0, 0.0, plan.start, 1, plan.stop))
        return [*calls, self.prepare("fmi2EnterInitializationMode"), self.prepare("fmi2ExitInitializationMode")]

    def start(self, point: Sequence[float]) -> None:
        """Initialize a run with the varied values."""
        for (buffer, i, number), value in zip(self.slots, point, strict=True):
            buffer[i] = number(value)
        check_calls(self.start_calls)

    def step_to_stop(self) -> None:
        """Run to the stop in one communication step."""
        check_calls(self.step_calls)

    def record_to_stop(self) -> Trajectory:
        """Run to the stop as planned, and return the trajectory."""
        return build_trajectory(self.plan, self.fmu, record_run(self.plan, self.fmu, lambda share: None, 0), 0.0)

    def read(self) -> list[float]:
        """Return the variables to read, reals first."""
        check_calls(self.read_calls)
        return [*self.reals, *self.integers]


def check_calls(calls: Iterable[LibraryCall]) -> None:
    """Call functions of the library; raise FMICallException if one of them fails."""
    for name, function, arguments in calls:
        status = function(*arguments)
        if status > WARNING:
            raise FMICallException(name, status)
