"""One instance of an FMU through fmpy: FMI 2.0 or 3.0, co-simulation or model exchange.

A step and a recorded point take only microseconds, so their functions and buffers are looked up once and the library is
called directly; everything else uses fmpy's methods.
"""

import io
import os
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, suppress
from ctypes import byref, c_bool, c_double, c_uint, c_void_p
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from fmpy import fmi2
from fmpy.fmi1 import FMICallException as FMICallException  # re-exported for adapters
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2LastSuccessfulTime, fmi2Terminated
from fmpy.fmi3 import FMU3Model, FMU3Slave

from ..errors import HarnessError, first_line

WARNING, DISCARD = 1, 2  # of the statuses; any status above a warning is a failure
STATUS_NAMES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
MAX_MESSAGES = 50  # log messages that are stored


class StepError(Exception):
    """The FMU did not complete a step."""


class TerminatedError(StepError):
    """The FMU terminated the simulation, at `t` in s if known."""

    def __init__(self, t: float | None, reason: str) -> None:
        super().__init__(f"it terminated the simulation: {reason}")
        self.t = t


class StepRefusedError(StepError):
    """The FMU rejected a step of this size; a shorter one may succeed."""


CALL_FAILURES = (FMICallException, StepError)

EVENT_MODE_OPTIONS = ("eventModeUsed", "earlyReturnAllowed")

PreparedCall = tuple[str, Any, tuple[Any, ...]]  # name, function and arguments


class LogCapture:
    """Log messages of an FMU, and its standard error if that is captured."""

    def __init__(self, stderr: io.StringIO | None = None) -> None:
        self.stderr = stderr
        self.messages: deque[tuple[int, str]] = deque(maxlen=MAX_MESSAGES)  # (status, text)

    def add(self, status: int, text: bytes | None) -> None:
        """Store a message."""
        self.messages.append((status, (text or b"").decode("utf-8", "replace")))

    @property
    def error_message(self) -> str:
        """Return the last message above a warning, or the last line on standard error; empty if there is none."""
        logged_errors = [text for status, text in self.messages if status > WARNING and text.strip()]
        printed_lines = self.stderr.getvalue().strip().splitlines() if self.stderr else []
        return " ".join((logged_errors or printed_lines or [""])[-1].split())

    def clear(self) -> None:
        """Discard all messages."""
        self.messages.clear()
        if self.stderr:
            self.stderr.seek(self.stderr.truncate(0))


class FmuInstance:
    """Instance of an unpacked FMU.

    Parameters
    ----------
    description : ModelDescription
        Model description of the FMU.
    folder : path
        Directory of the unpacked FMU.
    exchange : bool
        Whether to use model exchange instead of co-simulation.
    name : str, optional
        Name of the instance; by default its model identifier.
    log : LogCapture, optional
        Stores the log messages; by default a new log.
    ticks_clocks : bool
        Whether the caller ticks the clocks of an FMU of FMI 3.0. An FMU with clocks then runs in event mode in
        co-simulation, and is refused otherwise.

    Raises
    ------
    HarnessError
        If the FMU cannot be instantiated.
    """

    def __init__(
        self,
        description: Any,
        folder: Path | str,
        exchange: bool = False,
        name: str | None = None,
        log: LogCapture | None = None,
        ticks_clocks: bool = False,
    ) -> None:
        clocks = clocks_of(description)
        if clocks and not ticks_clocks:
            names = ", ".join(clock.name for clock in clocks)
            raise HarnessError(f"it has clocks ({names}), which only single runs, comparisons and sweeps tick")
        self.ticks_clocks = bool(clocks) and (exchange or description.coSimulation.hasEventMode)
        self.uses_event_mode = self.ticks_clocks and not exchange
        self.description, self.exchange, self.log = description, exchange, log or LogCapture()
        self.is_fmi2 = description.fmiVersion == "2.0"
        self.prefix = "fmi2" if self.is_fmi2 else "fmi3"
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.interface = description.modelExchange if exchange else description.coSimulation
        self.log.clear()
        self.fmu = self.instantiate(str(folder), name)
        self.component = c_void_p(self.fmu.component)
        self.is_new, self.reset_calls = True, (self.prepare_call("Reset"),)  # new: neither used nor initialized
        self.do_step = None if exchange else self.function("DoStep")
        # of fmi3DoStep: event handling needed, terminate simulation, early return, last successful time
        self.step_results = () if self.is_fmi2 else (c_bool(), c_bool(), c_bool(), c_double())
        self.step_arguments = tuple(byref(result) for result in self.step_results)

    def instantiate(self, folder: str, name: str | None) -> Any:
        """Return fmpy's instance."""
        classes: dict[tuple[bool, bool], Any] = {
            (True, False): FMU2Slave,
            (True, True): FMU2Model,
            (False, False): FMU3Slave,
            (False, True): FMU3Model,
        }
        try:
            fmu = classes[self.is_fmi2, self.exchange](
                guid=self.description.guid or "",
                unzipDirectory=folder,
                modelIdentifier=self.interface.modelIdentifier,
                instanceName=name,
            )
            log = self.log
            if self.is_fmi2:
                fmu.instantiate(loggingOn=True, callbacks=fmi2_callbacks(log))
            else:
                event_mode = {} if self.exchange else dict.fromkeys(EVENT_MODE_OPTIONS, self.uses_event_mode)
                fmu.instantiate(
                    loggingOn=True,
                    logMessage=lambda instance, status, category, text: log.add(status, text),
                    **event_mode,
                )
        except Exception as error:  # fmpy raises bare Exceptions
            hint = (
                "; it needs the tool that exported it (needsExecutionTool)" if self.interface.needsExecutionTool else ""
            )
            raise HarnessError(f"{first_line(error).replace(f'{folder}{os.sep}', '')}{hint}") from None
        return fmu

    def function(self, name: str) -> Any:
        """Return a function of the library, by its name without the prefix."""
        return getattr(self.fmu.dll, f"{self.prefix}{name}")

    def prepare_call(self, name: str, *arguments: Any) -> PreparedCall:
        """Return a call of a function of the library, by its name without the prefix, with constant arguments.

        Numbers are converted once. The function has no declared types, because ctypes would check these in each call,
        which takes as long as the call itself.
        """
        name, types = f"{self.prefix}{name}", self.function(name).argtypes
        converted_arguments = (
            kind(value) if isinstance(value, int | float) else value
            for kind, value in zip(types, (self.component, *arguments), strict=True)
        )
        return name, self.fmu.dll[name], tuple(converted_arguments)

    def initialize(
        self, values: Iterable[tuple[Any, Any]], start: float, stop: float | None, tolerance: float | None = None
    ) -> None:
        """Set (variable, value) and initialize the instance; times in s."""
        self.enter_initialization(values, start, stop, tolerance)
        self.fmu.exitInitializationMode()

    def enter_initialization(
        self, values: Iterable[tuple[Any, Any]], start: float, stop: float | None, tolerance: float | None = None
    ) -> None:
        """Set (variable, value) and enter the initialization of the instance; times in s."""
        experiment = {"tolerance": tolerance, "startTime": start, "stopTime": stop}
        values, self.is_new = list(values), False
        structural = [(variable, value) for variable, value in values if variable.causality == "structuralParameter"]
        if structural:
            self.fmu.enterConfigurationMode()
            for variable, value in structural:
                self.set(variable, value)
            self.fmu.exitConfigurationMode()
        if self.is_fmi2:
            self.fmu.setupExperiment(**experiment)
        for variable, value in values:
            if variable.causality != "structuralParameter":
                self.set(variable, value)
        self.fmu.enterInitializationMode(**({} if self.is_fmi2 else experiment))

    def type_name(self, variable: Any) -> str:
        """Return the type in the names of the functions that set and get a variable."""
        if variable.type == "Enumeration":
            return "Integer" if self.is_fmi2 else "Int64"
        return str(variable.type)

    def set(self, variable: Any, value: Any) -> None:
        """Set a variable of any type; an array from a list in row-major order."""
        setter = getattr(self.fmu, f"set{self.type_name(variable)}")
        setter([variable.valueReference], value if isinstance(value, list) else [value])

    def get(self, name: str) -> Any:
        """Return the value of a scalar variable that is no string."""
        variable = self.variables[name]
        getter = getattr(self.fmu, f"get{self.type_name(variable)}")
        return getter([variable.valueReference])[0]

    def step(self, t: float, h: float) -> None:
        """Take a communication step of h from t, in s.

        Raises
        ------
        TerminatedError
            If the FMU terminates the simulation.
        StepRefusedError
            If the FMU rejects the step.
        FMICallException
            If the step fails.
        HarnessError
            If the FMU returns early, which is not allowed.
        """
        status = self.do_step(self.component, t, h, 1, *self.step_arguments)  # type: ignore[misc]
        if status > WARNING:
            raise self.step_failure(status, t, h)
        if self.step_results:
            _, terminate, early, last_time = (result.value for result in self.step_results)
            if terminate:
                raise TerminatedError(last_time if early else t + h, "fmi3DoStep returned terminateSimulation")
            if early and not self.uses_event_mode:
                raise HarnessError("fmi3DoStep returned early without permission")

    def step_failure(self, status: int, t: float, h: float) -> Exception:
        """Return the exception for a step with a status above a warning."""
        name = f"{self.prefix}DoStep"
        if status != DISCARD:
            return FMICallException(name, status)
        is_terminated, last_time = False, None
        if self.is_fmi2:
            with suppress(FMICallException):  # these queries are optional
                is_terminated = self.fmu.getBooleanStatus(fmi2Terminated)
                last_time = self.fmu.getRealStatus(fmi2LastSuccessfulTime)
        if is_terminated:
            return TerminatedError(last_time, f"{name} returned Discard with fmi2Terminated")
        return StepRefusedError(f"{name} returned Discard for a step of {h:.4g} s at t = {t:.9g} s")

    def make_references(self, variables: Sequence[Any]) -> Any:
        """Return the value references of variables, for prepared calls."""
        return (c_uint * len(variables))(*(variable.valueReference for variable in variables))

    def reset(self) -> None:
        """Reset the instance and discard its messages."""
        self.log.clear()
        self.call_reset()
        self.is_new = True

    def restart(self) -> None:
        """Discard all messages, and reset the instance unless it is new, to initialize it."""
        self.log.clear()
        if not self.is_new:
            self.call_reset()
        self.is_new = False

    def call_reset(self) -> None:
        """Reset the instance."""
        call_all(self.reset_calls)

    def close(self) -> None:
        """Free the instance."""
        self.fmu.freeInstance()


def call_all(calls: Iterable[PreparedCall]) -> None:
    """Call functions of the library; raise FMICallException if one of them fails."""
    for name, function, arguments in calls:
        status = function(*arguments)
        if status > WARNING:
            raise FMICallException(name, status)


def clocks_of(description: Any) -> list[Any]:
    """Return the clocks of an FMU, which FMI 3.0 has."""
    return [variable for variable in description.modelVariables if variable.type == "Clock"]


LOGS: WeakValueDictionary[int, LogCapture] = WeakValueDictionary()  # by the component environment of FMI 2.0


def log_fmi2_message(environment: int | None, name: bytes, status: int, category: bytes, text: bytes) -> None:
    """Store a log message of FMI 2.0, in the last log if the FMU does not pass its environment."""
    log = LOGS.get(environment or 0) or LOGS.get(max(LOGS, default=0))
    if log is not None:
        log.add(status, text)


@cache
def shared_logger() -> Any:
    """Return the logger of FMI 2.0 with fmpy's proxy. It is created once: the proxy always calls the last logger."""
    functions = fmi2.fmi2CallbackFunctions()
    functions.logger = fmi2.fmi2CallbackLoggerTYPE(log_fmi2_message)
    fmi2.addLoggerProxy(byref(functions))
    return functions


def fmi2_callbacks(log: LogCapture) -> fmi2.fmi2CallbackFunctions:
    """Return the callbacks of an instance of FMI 2.0, which must live as long as the instance."""
    environment = max(LOGS, default=0) + 1
    LOGS[environment] = log
    functions = fmi2.fmi2CallbackFunctions()
    functions.logger = shared_logger().logger
    functions.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
    functions.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
    functions.componentEnvironment = environment
    return functions


@contextmanager
def capture_stderr() -> Iterator[io.StringIO]:
    """Capture standard error of FMUs in Python and discard that of others.

    The log contains the same messages.
    """
    buffer = io.StringIO()
    with ExitStack() as restore, redirect_stderr(buffer):
        with suppress(OSError):  # there is no standard error
            stderr_copy = os.dup(2)
            restore.callback(os.close, stderr_copy)
            restore.callback(os.dup2, stderr_copy, 2)
            with open(os.devnull, "w") as null:
                os.dup2(null.fileno(), 2)
        yield buffer
