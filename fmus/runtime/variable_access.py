"""Reading and writing variables by their value references."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from . import call_sequence, messages
from .codes import DIVERGED, OK, UNKNOWN_REFERENCE
from .failure_handling import FailureHandling
from .pythonfmu_workarounds import signal_safe

SETTABLE_CAUSALITIES = ("parameter", "input")
UNKNOWN_NAME = ""  # among the values that cannot be used: one for a variable that is not there
MAX_READERS = 64  # an importer that asks for other lists all the time costs time, not memory


def make_getter(kind: str, blank: object) -> Any:
    """The method that reads variables of a kind; `blank` answers for those that are not there."""

    @signal_safe
    def get(slave: VariableAccess, references: list[int]) -> list[Any]:
        try:
            last_readers, values, counts, ahead = slave.last_readers[kind]
            if last_readers != references:
                last_readers, values, counts, ahead = slave.compile_reader(kind, references, blank)
            run = slave.run
            if not run.outputs_current and not run.has_failed:
                slave.update_outputs()
            if counts and run.outputs_current:
                slave.update_statistics(ahead)
            return values(slave.model)
        except BaseException as error:  # an exception that left Python would crash the host
            slave.handle_exception(error)
            return [blank for _ in references]

    return get


def make_setter(kind: str) -> Any:
    """The method that writes variables of a kind."""

    @signal_safe
    def put(slave: VariableAccess, references: list[int], values: Sequence[float]) -> None:
        try:
            for i, reference in enumerate(references):
                if slave.has_type(kind, reference):
                    slave.set_value(reference, values[i])
                elif (
                    UNKNOWN_NAME not in slave.invalid_values
                ):  # its value is not touched: a text not in UTF-8 is no object at all
                    slave.set_invalid(UNKNOWN_NAME, unknown_reference_message(kind, reference))
        except BaseException as error:  # as above
            slave.handle_exception(error)

    return put


class VariableAccess(FailureHandling):
    """The part of an instance that reads and writes; a value reference is a place in `variables`."""

    def initialize_access(self) -> None:
        """To the variables of a new model."""
        self.attribute_owners = [self.locate(name) for name, _ in self.variables]
        # what reads a list of value references, by kind and references; the same by kind, for those last asked for
        self.readers: dict[tuple[object, ...], Any] = {}
        self.last_readers: dict[str, Any] = dict.fromkeys(
            ("Real", "Integer", "Boolean", "String"), (None, None, False, False)
        )
        self.invalid_values = {}

    def attribute_path(self, name: str) -> str:
        """Where in the model a variable is."""
        return name

    def locate(self, name: str) -> tuple[object, str]:
        """The object that holds a variable, and the name of the attribute there."""
        thing: object = self.model
        *path, last = self.attribute_path(name).split(".")
        for part in path:
            thing = getattr(thing, part)
        return thing, last

    def has_type(self, kind: str, reference: int) -> bool:
        """Whether a reference is that of a variable of the kind."""
        if not 0 <= reference < len(self.variables):
            return False
        return kind == ("Real" if self.variables[reference][1].type == "Real" else "Integer")

    # ---- reading

    def compile_reader(self, kind: str, references: list[int], blank: object) -> tuple[list[int], Any, bool, bool]:
        """The references, what reads them, whether they tell of the solver, and whether it must look ahead first."""
        key = kind, *references
        if key in self.readers:
            known: tuple[list[int], Any, bool, bool] = self.readers[key]
            self.last_readers[kind] = known
            return known
        there = [self.has_type(kind, reference) for reference in references]
        places = [
            self.attribute_path(self.variables[r][0]) if has_type else "" for r, has_type in zip(references, there)
        ]
        terms = ["model." + attribute_path if attribute_path else "blank" for attribute_path in places]
        values = eval(f"lambda model: [{', '.join(terms)}]", {"blank": blank})  # no other is as fast
        found = (
            list(references),
            values,
            any("." in attribute_path for attribute_path in places),
            "solver.t_next" in places,
        )
        if not all(there):
            self.report_error(unknown_reference_message(kind, references[there.index(False)]))
            return found
        if len(self.readers) == MAX_READERS:
            self.readers.clear()
        self.last_readers[kind] = self.readers[key] = found
        return found

    def update_statistics(self, ahead: bool) -> None:
        """Bring what is told of solver and events to the present point; `ahead`: also where the next step ends."""
        call_sequence.update_statistics(self.model, ahead)

    def update_outputs(self) -> None:
        """Bring the outputs to the present point; NaN while the values cannot be used."""
        status = call_sequence.update_outputs(self.run, self.model)
        if status == DIVERGED:
            raise OverflowError
        if status != OK:
            self.set_outputs_to_nan()

    # ---- writing

    def set_value(self, reference: int, value: float) -> None:
        """Take over a value; one that cannot be used is remembered, and told by the next step."""
        name, declared = self.variables[reference]
        thing, attribute = self.attribute_owners[reference]
        if value == getattr(thing, attribute) and name not in self.invalid_values:
            return
        calculated, fixed = declared.causality not in SETTABLE_CAUSALITIES, declared.variability == "fixed"
        reason = call_sequence.rejection_reason(self.run, calculated, fixed, declared.accepts(value))
        if reason == OK:
            self.set_invalid(name, "")
            call_sequence.note_change(self.run, self.model)
            setattr(thing, attribute, value)
        else:
            self.set_invalid(name, messages.value_message(reason, name, declared, value))

    def set_invalid(self, name: str, sentence: str) -> None:
        """Remember what is said of a value that was set, the last of all; no sentence: it can be used."""
        run = self.run
        run.outputs_current = False
        self.invalid_values.pop(name, None)
        if sentence:
            self.invalid_values[name] = sentence
        run.n_invalid_values = len(self.invalid_values)


def unknown_reference_message(kind: str, reference: int) -> str:
    """The sentence about a value reference, which the layer hands over as if it had a sign."""
    return messages.CALL_MESSAGES[UNKNOWN_REFERENCE].format(reference=reference & 0xFFFFFFFF, word=kind)
