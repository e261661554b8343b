"""An instance that fails says one sentence, and answers NaN from then on; nothing on this way raises."""

from __future__ import annotations

from contextlib import suppress
from math import nan
from typing import Any

from . import messages
from .call_sequence import RunState
from .codes import BAD_VALUE, DIVERGED, FAILED, INTERRUPTED
from .pythonfmu_workarounds import reraise_later, sanitize, write_to_stderr
from .variable_declarations import VariableDeclaration

ERROR = 3  # a status of FMI, in all its versions
CALCULATED_CAUSALITIES = ("output", "local")  # causalities of what is calculated


class FailureHandling:
    """The part of an instance that says what is wrong."""

    variables: list[tuple[str, VariableDeclaration]]  # name and declaration of each
    instance_name: str
    log: Any  # takes a sentence and a status
    _get_log_queue: Any
    model: Any
    run: RunState
    attribute_owners: list[tuple[object, str]]  # the object that holds a variable, and the name of the attribute there
    invalid_values: dict[str, str]  # name -> sentence: values that were set and cannot be used
    pending_exception: object  # what will raise an exception of the host's again

    def fail_with_status(self, status: int, t: float = nan, h: float = nan) -> bool:
        """Fail for the reason that the rules give, in a communication step of h from t."""
        if status == FAILED:
            return False  # which has been told
        if status == BAD_VALUE:
            return self.fail(next(iter(self.invalid_values.values())))
        return self.fail(messages.run_message(status, self.run, self.model, t, h))

    def fail(self, sentence: str) -> bool:
        """Say the sentence, and answer NaN from now on."""
        self.run.has_failed, self.run.outputs_current = True, False
        self.set_outputs_to_nan()
        self.report_error(sentence)
        return False

    def report_error(self, sentence: str) -> None:
        """In the log and on standard error."""
        self.log(sanitize(sentence), ERROR)
        write_to_stderr(f"{type(self).__name__} ({self.instance_name}): {sentence}")

    def handle_exception(self, error: BaseException) -> bool:
        """Fail by an exception; one that is the host's, as an interrupt, reaches it when the call is over."""
        with suppress(Exception):
            if not isinstance(error, Exception):
                self.fail_with_status(INTERRUPTED)
                self.pending_exception = reraise_later(error, self._get_log_queue()[-1])
            elif isinstance(error, (ArithmeticError, ValueError)) and not isinstance(error, UnicodeError):
                self.fail_with_status(DIVERGED)  # plain floats raise where C gives infinity or NaN
            else:
                self.fail(f"unforeseen {type(error).__name__}: {error}; please report it with the values of the run")
        return False

    def set_outputs_to_nan(self) -> None:
        """Every calculated Real reads NaN."""
        for (_, declared), (thing, name) in zip(self.variables, self.attribute_owners):
            if declared.type == "Real" and declared.causality in CALCULATED_CAUSALITIES:
                setattr(thing, name, nan)
