"""Access to variables by value reference."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from typing import Any

from . import call_sequence, messages
from .codes import DIVERGED, NO_VALUE, OK, UNKNOWN_REFERENCE
from .failure_handling import FailureHandling
from .pythonfmu_workarounds import signal_safe
from .variable_declarations import exported_name

SETTABLE_CAUSALITIES = ("parameter", "input")
UNKNOWN_NAME = ""  # key in invalid_values for an unknown value reference
MAX_READERS = 64  # bounds the memory if an importer keeps asking for new lists


def make_getter(kind: str, blank: object) -> Any:
    """Make the method that reads variables of a type; `blank` is returned for unknown ones."""

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
            return values(slave.model, run)
        except BaseException as error:  # an exception outside Python would crash the host
            slave.handle_exception(error)  # sets calculated values to NaN; parameters read what was set
            last_readers, values, *_ = slave.last_readers[kind]
            if last_readers == references:
                return values(slave.model, slave.run)
            return [blank for _ in references]

    return get


def make_setter(kind: str) -> Any:
    """Make the method that writes variables of a type."""

    @signal_safe
    def put(slave: VariableAccess, references: list[int], values: Sequence[float]) -> None:
        try:
            for i, reference in enumerate(references):
                if slave.has_type(kind, reference):
                    slave.set_value(reference, values[i])
                # the value is not accessed: a string that is not UTF-8 is no Python object
                elif not slave.invalid_values.get(UNKNOWN_NAME):
                    slave.set_invalid(UNKNOWN_NAME, unknown_reference_message(kind, reference))
        except BaseException as error:  # as above
            slave.handle_exception(error)

    return put


class VariableAccess(FailureHandling):
    """Mixin of an FMU instance that reads and writes variables; value references are indices into `variables`."""

    def initialize_access(self) -> None:
        """Initialize the access to the variables of a new model."""
        self.attribute_owners = [self.locate(name) for name, _ in self.variables]
        # of inputs that vary between settings: the polynomial by name
        self.polynomials = {name: getattr(self.model, f"{name}_polynomial") for name, _ in self.model.prescribed_inputs}
        # compiled reader by type and value references; the last one used, by type
        self.readers: dict[tuple[object, ...], Any] = {}
        self.last_readers: dict[str, Any] = dict.fromkeys(
            ("Real", "Integer", "Boolean", "String"), (None, None, False, False)
        )
        self.invalid_values = {}
        self.last_refusal = "", nan

    def locate(self, name: str) -> tuple[object, str]:
        """Return the object that owns a variable, and the name of the attribute."""
        *path, last = name.split(".")
        owner: object = self.run if path else self.model
        for part in path:
            owner = getattr(owner, part)
        return owner, last

    def has_type(self, kind: str, reference: int) -> bool:
        """Return whether a value reference belongs to a variable of the type."""
        if not 0 <= reference < len(self.variables):
            return False
        return kind == ("Real" if self.variables[reference][1].type == "Real" else "Integer")

    # ---- reading

    def compile_reader(self, kind: str, references: list[int], blank: object) -> tuple[list[int], Any, bool, bool]:
        """Compile a reader for a list of value references.

        Returns
        -------
        tuple
            The references, the reader, whether it needs statistics, and whether it needs solver.t_next.
        """
        key = kind, *references
        if key in self.readers:
            entry: tuple[list[int], Any, bool, bool] = self.readers[key]
            self.last_readers[kind] = entry
            return entry
        is_known = [self.has_type(kind, reference) for reference in references]
        names = [self.variables[reference][0] if is_valid else "" for reference, is_valid in zip(references, is_known)]
        owners = ["run" if "." in name else "model" for name in names]
        terms = [f"{owner}.{name}" if name else "blank" for owner, name in zip(owners, names)]
        if kind == "Real":
            integers = [
                is_valid and self.variables[reference][1].is_integer
                for reference, is_valid in zip(references, is_known)
            ]
            terms = [f"integer_as_real({term})" if integer else term for term, integer in zip(terms, integers)]
        scope = {"blank": blank, "integer_as_real": integer_as_real}
        items = ", ".join(terms)  # Python 3.12 writes quotes in an f-string so that older ones cannot read them
        values = eval(f"lambda model, run: [{items}]", scope)  # the fastest way
        entry = (
            list(references),
            values,
            "run" in owners,
            "solver.t_next" in names,
        )
        if not all(is_known):
            self.report_error(unknown_reference_message(kind, references[is_known.index(False)]))
            return entry
        if len(self.readers) == MAX_READERS:
            self.readers.clear()
        self.last_readers[kind] = self.readers[key] = entry
        return entry

    def update_statistics(self, ahead: bool) -> None:
        """Update the statistics of solver and events to the current time; with `ahead` also solver.t_next."""
        call_sequence.update_statistics(self.run, self.model, ahead)

    def update_outputs(self) -> None:
        """Update the outputs to the current time; NaN while values are invalid."""
        status = call_sequence.update_outputs(self.run, self.model)
        if status == DIVERGED:
            raise OverflowError
        if status != OK:
            self.set_outputs_to_nan()

    # ---- writing

    def set_value(self, reference: int, value: float) -> None:
        """Set a value; an invalid one is recorded, and the next step reports it."""
        name, declaration = self.variables[reference]
        owner, attribute = self.attribute_owners[reference]
        if value == getattr(owner, attribute) and name not in self.invalid_values and not self.is_moving(name):
            return
        is_calculated, is_fixed = declaration.causality not in SETTABLE_CAUSALITIES, declaration.variability == "fixed"
        reason = call_sequence.rejection_reason(self.run, is_calculated, is_fixed, declaration.accepts(value))
        if reason == OK:
            self.set_invalid(name, "")
            call_sequence.note_change(self.run, self.model)
            setattr(owner, attribute, value)
            self.last_refusal = "", nan  # the next refusal is one of other values
        else:
            self.set_invalid(name, messages.value_message(reason, exported_name(name, declaration), declaration, value))

    def is_moving(self, name: str) -> bool:
        """Return whether a variable is an input that varies between settings, so that its attribute may be outdated."""
        return name in self.polynomials and self.polynomials[name].order > 0

    def set_invalid(self, name: str, message: str) -> None:
        """Record the message for an invalid value; an empty message marks the value as valid."""
        run = self.run
        run.outputs_current = False
        self.invalid_values.pop(name, None)
        if message:
            self.invalid_values[name] = message
        run.n_invalid_values = len(self.invalid_values)


def integer_as_real(value: int) -> float:
    """Return an integer as a Real, which is NaN if it has no value."""
    return nan if value == NO_VALUE else float(value)


def unknown_reference_message(kind: str, reference: int) -> str:
    """Return the message for an unknown value reference, which the native layer passes as a signed integer."""
    return messages.CALL_MESSAGES[UNKNOWN_REFERENCE].format(reference=reference & 0xFFFFFFFF, word=kind)
