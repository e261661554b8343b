"""An instance that fails says one sentence, and answers NaN from then on; nothing on this way raises."""

from __future__ import annotations

from contextlib import suppress
from math import nan
from typing import Any

from . import sentences
from .boundary import announce, pass_on, printable
from .codes import BAD_VALUE, DIVERGED, FAILED, INTERRUPTED
from .declare import Declared
from .rules import Run

ERROR = 3  # a status of FMI, in all its versions
ANSWERS = ("output", "local")  # causalities of what is calculated


class Failing:
    """The part of an instance that says what is wrong."""

    variables: list[tuple[str, Declared]]  # name and declaration of each
    instance_name: str
    log: Any  # takes a sentence and a status
    _get_log_queue: Any
    model: Any
    run: Run
    owners: list[tuple[object, str]]  # the object that holds a variable, and the name of the attribute there
    refused: dict[str, str]  # name -> sentence: values that were set and cannot be used
    passing: object  # what will raise an exception of the host's again

    def give_up(self, status: int, t: float = nan, h: float = nan) -> bool:
        """Fail for the reason that the rules give, in a communication step of h from t."""
        if status == FAILED:
            return False  # which has been told
        if status == BAD_VALUE:
            return self.fail(next(iter(self.refused.values())))
        return self.fail(sentences.of_run(status, self.run, self.model, t, h))

    def fail(self, sentence: str) -> bool:
        """Say the sentence, and answer NaN from now on."""
        self.run.failed, self.run.observed = True, False
        self.silence()
        self.say(sentence)
        return False

    def say(self, sentence: str) -> None:
        """In the log and on standard error."""
        self.log(printable(sentence), ERROR)
        announce(f"{type(self).__name__} ({self.instance_name}): {sentence}")

    def rescue(self, error: BaseException) -> bool:
        """Fail by an exception; one that is the host's, as an interrupt, reaches it when the call is over."""
        with suppress(Exception):
            if not isinstance(error, Exception):
                self.give_up(INTERRUPTED)
                self.passing = pass_on(error, self._get_log_queue()[-1])
            elif isinstance(error, (ArithmeticError, ValueError)) and not isinstance(error, UnicodeError):
                self.give_up(DIVERGED)  # plain floats raise where C gives infinity or NaN
            else:
                self.fail(f"unforeseen {type(error).__name__}: {error}; please report it with the values of the run")
        return False

    def silence(self) -> None:
        """Every calculated Real reads NaN."""
        for (_, declared), (thing, name) in zip(self.variables, self.owners):
            if declared.type == "Real" and declared.causality in ANSWERS:
                setattr(thing, name, nan)
