"""Reading and writing variables by their value references."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from . import rules, sentences
from .boundary import guarded
from .codes import DIVERGED, NO_VARIABLE, OK
from .failure import Failing

SETTABLE = ("parameter", "input")
NOWHERE = ""  # among the values that cannot be used: one for a variable that is not there
MOST_READERS = 64  # an importer that asks for other lists all the time costs time, not memory


def getter(kind: str, blank: object) -> Any:
    """The method that reads variables of a kind; `blank` answers for those that are not there."""

    @guarded
    def get(slave: Values, references: list[int]) -> list[Any]:
        try:
            asked, values, counts, ahead = slave.asked[kind]
            if asked != references:
                asked, values, counts, ahead = slave.reader(kind, references, blank)
            run = slave.run
            if not run.observed and not run.failed:
                slave.observe()
            if counts and run.observed:
                slave.report(ahead)
            return values(slave.model)
        except BaseException as error:  # an exception that left Python would crash the host
            slave.rescue(error)
            return [blank for _ in references]

    return get


def setter(kind: str) -> Any:
    """The method that writes variables of a kind."""

    @guarded
    def put(slave: Values, references: list[int], values: Sequence[float]) -> None:
        try:
            for i, reference in enumerate(references):
                if slave.is_one(kind, reference):
                    slave.write(reference, values[i])
                elif NOWHERE not in slave.refused:  # its value is not touched: a text not in UTF-8 is no object at all
                    slave.refuse(NOWHERE, no_variable(kind, reference))
        except BaseException as error:  # as above
            slave.rescue(error)

    return put


class Values(Failing):
    """The part of an instance that reads and writes; a value reference is a place in `variables`."""

    def give_access(self) -> None:
        """To the variables of a new model."""
        self.owners = [self.owner(name) for name, _ in self.variables]
        # what reads a list of value references, by kind and references; the same by kind, for those last asked for
        self.readers: dict[tuple[object, ...], Any] = {}
        self.asked: dict[str, Any] = dict.fromkeys(("Real", "Integer", "Boolean", "String"), (None, None, False, False))
        self.refused = {}

    def place(self, name: str) -> str:
        """Where in the model a variable is."""
        return name

    def owner(self, name: str) -> tuple[object, str]:
        """The object that holds a variable, and the name of the attribute there."""
        thing: object = self.model
        *path, last = self.place(name).split(".")
        for part in path:
            thing = getattr(thing, part)
        return thing, last

    def is_one(self, kind: str, reference: int) -> bool:
        """Whether a reference is that of a variable of the kind."""
        if not 0 <= reference < len(self.variables):
            return False
        return kind == ("Real" if self.variables[reference][1].type == "Real" else "Integer")

    # ---- reading

    def reader(self, kind: str, references: list[int], blank: object) -> tuple[list[int], Any, bool, bool]:
        """The references, what reads them, whether they tell of the solver, and whether it must look ahead first."""
        key = kind, *references
        if key in self.readers:
            known: tuple[list[int], Any, bool, bool] = self.readers[key]
            self.asked[kind] = known
            return known
        there = [self.is_one(kind, reference) for reference in references]
        places = [self.place(self.variables[r][0]) if is_one else "" for r, is_one in zip(references, there)]
        terms = ["model." + place if place else "blank" for place in places]
        values = eval(f"lambda model: [{', '.join(terms)}]", {"blank": blank})  # no other is as fast
        found = list(references), values, any("." in place for place in places), "solver.t_next" in places
        if not all(there):
            self.say(no_variable(kind, references[there.index(False)]))
            return found
        if len(self.readers) == MOST_READERS:
            self.readers.clear()
        self.asked[kind] = self.readers[key] = found
        return found

    def report(self, ahead: bool) -> None:
        """Bring what is told of solver and events to the present point; `ahead`: also where the next step ends."""
        rules.report(self.model, ahead)

    def observe(self) -> None:
        """Bring the outputs to the present point; NaN while the values cannot be used."""
        status = rules.observe(self.run, self.model)
        if status == DIVERGED:
            raise OverflowError
        if status != OK:
            self.silence()

    # ---- writing

    def write(self, reference: int, value: float) -> None:
        """Take over a value; one that cannot be used is remembered, and told by the next step."""
        name, declared = self.variables[reference]
        thing, attribute = self.owners[reference]
        if value == getattr(thing, attribute) and name not in self.refused:
            return
        calculated, fixed = declared.causality not in SETTABLE, declared.variability == "fixed"
        reason = rules.reason(self.run, calculated, fixed, declared.accepts(value))
        if reason == OK:
            self.refuse(name, "")
            rules.change(self.run, self.model)
            setattr(thing, attribute, value)
        else:
            self.refuse(name, sentences.of_value(reason, name, declared, value))

    def refuse(self, name: str, sentence: str) -> None:
        """Remember what is said of a value that was set, the last of all; no sentence: it can be used."""
        run = self.run
        run.observed = False
        self.refused.pop(name, None)
        if sentence:
            self.refused[name] = sentence
        run.refused = len(self.refused)


def no_variable(kind: str, reference: int) -> str:
    """The sentence about a value reference, which the layer hands over as if it had a sign."""
    return sentences.CALLS[NO_VARIABLE].format(reference=reference & 0xFFFFFFFF, word=kind)
