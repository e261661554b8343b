"""An instance that fails says one sentence, and answers NaN from then on; nothing on this way raises."""

from contextlib import suppress
from math import nan

from . import sentences
from .boundary import announce, pass_on, printable
from .codes import BAD_VALUE, DIVERGED, FAILED, INTERRUPTED

ERROR = 3  # a status of FMI, in all its versions
CALCULATED = ("output", "local")


class Failing:
    """The part of an instance that says what is wrong.

    The instance has model, run, variables and owners; refused, a sentence for each value that cannot be used;
    instance_name and log(sentence, status).
    """

    def give_up(self, status, t=nan, h=nan):
        """Fail for the reason that the rules give, in a communication step of h from t."""
        if status == FAILED:
            return False  # which has been told
        if status == BAD_VALUE:
            return self.fail(next(iter(self.refused.values())))
        return self.fail(sentences.of_run(status, self.run, self.model, t, h))

    def fail(self, sentence):
        """Say the sentence, and answer NaN from now on."""
        self.run.failed, self.run.observed = True, False
        self.silence()
        self.say(sentence)
        return False

    def say(self, sentence):
        """In the log and on standard error."""
        self.log(printable(sentence), ERROR)
        announce(f"{type(self).__name__} ({self.instance_name}): {sentence}")

    def rescue(self, error):
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

    def silence(self):
        """Every calculated Real reads NaN."""
        for (_, declared), (thing, name) in zip(self.variables, self.owners):
            if declared.type == "Real" and declared.causality in CALCULATED:
                setattr(thing, name, nan)
