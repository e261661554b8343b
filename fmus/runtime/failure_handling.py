"""Failure of an instance: logs one message and sets calculated variables to NaN; never raises."""

from __future__ import annotations

from contextlib import suppress
from math import nan
from typing import Any

from . import messages
from .codes import BAD_VALUE, DIVERGED, FAILED, INTERRUPTED, NO_VALUE
from .pythonfmu_workarounds import reraise_later, sanitize, write_to_stderr
from .run_state import RunState
from .variable_declarations import VariableDeclaration

WARNING, ERROR = 1, 3  # status codes in all versions of FMI


class FailureHandling:
    """Mixin of an FMU instance that reports failures."""

    variables: list[tuple[str, VariableDeclaration]]  # name and declaration
    instance_name: str
    log: Any  # callable with message and status
    _get_log_queue: Any
    model: Any
    run: RunState
    attribute_owners: list[tuple[object, str]]  # owner and attribute name of each variable
    invalid_values: dict[str, str]  # name -> message, for rejected values; empty once a step was refused for it
    has_warned: bool  # about the rate of an input
    last_refusal: tuple[str, float]  # message, and the time that the run had reached
    pending_exception: object  # weak reference that re-raises an exception of the host

    def fail_with_status(self, status: int, t: float = nan, h: float = nan) -> bool:
        """Fail with a status, in a communication step of size h from t; return False."""
        if status == FAILED:
            return False  # already reported
        return self.fail(self.status_message(status, t, h))

    def refuse_step(self, status: int, t: float, h: float) -> bool:
        """Report why a communication step is refused; return False.

        The instance stays as it was.  The messages of invalid values become empty, because they were reported.  A host
        that sets the same invalid value at every step and ignores refusals gets one report: the time stays the same.
        """
        refusal = self.status_message(status, t, h), self.run.solver.t
        if status != BAD_VALUE or refusal != self.last_refusal:
            self.report_error(refusal[0])
        self.last_refusal = refusal
        self.invalid_values = dict.fromkeys(self.invalid_values, "")
        return False

    def status_message(self, status: int, t: float, h: float) -> str:
        """Return the message for a status."""
        if status == BAD_VALUE:
            return next(filter(None, self.invalid_values.values()))
        return messages.run_message(status, self.run, self.model, t, h)

    def fail(self, message: str) -> bool:
        """Report a message and set all calculated variables to NaN; return False."""
        self.run.has_failed, self.run.outputs_current = True, False
        self.set_outputs_to_nan()
        self.report_error(message)
        return False

    def report_error(self, message: str) -> None:
        """Write a message to the log and to standard error."""
        self.log(sanitize(message), ERROR)
        write_to_stderr(f"{type(self).__name__} ({self.instance_name}): {message}")

    def warn_of_inconsistent_rate(self) -> None:
        """Log once that an input jumps against its rate."""
        if not self.has_warned:
            self.has_warned = True
            self.log(sanitize(messages.inconsistent_rate_message(self.run, self.model)), WARNING)

    def handle_exception(self, error: BaseException) -> bool:
        """Turn an exception into a failure; exceptions of the host, as an interrupt, are re-raised after the call."""
        with suppress(Exception):
            if not isinstance(error, Exception):
                self.fail_with_status(INTERRUPTED)
                self.pending_exception = reraise_later(error, self._get_log_queue()[-1])
            elif isinstance(error, (ArithmeticError, ValueError)) and not isinstance(error, UnicodeError):
                self.fail_with_status(DIVERGED)  # Python raises where C returns infinity or NaN
            else:
                self.fail(
                    f"unexpected {type(error).__name__}: {error}; please report it with the parameter values of the run"
                )
        return False

    def set_outputs_to_nan(self) -> None:
        """Set every calculated Real to NaN, and every output that is an integer to a value that is no mode."""
        for (_, declaration), (owner, name) in zip(self.variables, self.attribute_owners):
            if lacks_value_after_failure(declaration):
                setattr(owner, name, NO_VALUE if declaration.is_integer else nan)


def lacks_value_after_failure(declaration: VariableDeclaration) -> bool:
    """Return whether a variable has no value after a failure: calculated Reals and outputs, but no counter."""
    return declaration.causality == "output" or (declaration.causality == "local" and declaration.type == "Real")
