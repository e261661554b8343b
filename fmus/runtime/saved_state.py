"""Saved states: what one holds, what its bytes are (a checksum, then JSON), and whether they may be taken over."""

from __future__ import annotations

import json
from binascii import crc32
from typing import Any
from weakref import WeakSet

from . import call_sequence
from .codes import INVALID_STATE
from .messages import CALL_MESSAGES
from .pythonfmu_workarounds import add_references, sanitize, signal_safe, write_to_stderr
from .variable_access import SETTABLE_CAUSALITIES, UNKNOWN_NAME, VariableAccess

AttributeTree = dict[str, Any]  # the name of every number with None, and of every object with the shape of that

MAX_BYTES = 1 << 20  # bytes; a state has some thousand
MAX_NESTING = 400  # brackets: what they nest must not overflow the parser
INT64_LIMIT = 1 << 63  # integers are those of C

INVALID_STATE_MESSAGE = CALL_MESSAGES[INVALID_STATE]


def to_bytes(state: object) -> bytes:
    """The bytes of a state."""
    text = json.dumps(state).encode()
    return b"%08x" % crc32(text) + text


def from_bytes(content: bytes) -> Any:
    """What the bytes hold, or None where they cannot be a state."""
    seal, text = content[:8], content[8:]
    if len(text) > MAX_BYTES or seal != b"%08x" % crc32(text) or text.count(b"[") + text.count(b"{") > MAX_NESTING:
        return None
    try:
        return json.loads(text, parse_int=parse_integer)
    except (ValueError, RecursionError):
        return None


def parse_integer(text: str) -> int:
    """As int, which takes minutes for a million digits."""
    return int(text[:20])


def matches_pattern(value: Any, pattern: Any) -> bool:
    """Whether a value has the very names, types and lengths of the pattern."""
    if type(value) is not type(pattern):
        return False
    if type(value) is dict:
        return list(value) == list(pattern) and all(matches_pattern(value[name], pattern[name]) for name in pattern)
    if type(value) is list:
        return len(value) == len(pattern) and all(map(matches_pattern, value, pattern))
    return type(value) is not int or -INT64_LIMIT <= value < INT64_LIMIT


def attribute_tree(thing: object) -> AttributeTree:
    """The name of every number of an object with None, and of every object it owns with the shape of that."""
    return {name: attribute_tree(value) if hasattr(value, "__dict__") else None for name, value in vars(thing).items()}


def read_numbers(thing: object, names: AttributeTree) -> dict[str, Any]:
    """All numbers of an object and of the objects it owns, as its shape names them: a flat copy that JSON can hold."""
    kept = {}
    for name, inner in names.items():
        value = getattr(thing, name)
        kept[name] = (
            read_numbers(value, inner) if inner is not None else list(value) if isinstance(value, list) else value
        )
    return kept


def write_numbers(thing: object, names: AttributeTree, kept: dict[str, Any]) -> None:
    """Put the numbers back, under the names of the shape and no others."""
    for name, inner in names.items():
        value = kept[name]
        if inner is not None:
            write_numbers(getattr(thing, name), inner, value)
        else:
            setattr(thing, name, list(value) if isinstance(value, list) else value)


RUN_TREE = attribute_tree(call_sequence.RunState(0.0))


class InvalidStateError(ValueError):
    """What is not a saved state of this FMU; the layer tells the host what it reads here."""

    def __repr__(self) -> str:
        return INVALID_STATE_MESSAGE


class SavedStateAccess(VariableAccess):
    """The part of an instance that saves and restores its state."""

    # of the subclass that hosting() makes
    attribute_tree: AttributeTree
    instances: WeakSet[Any]
    plain_class: Any

    @signal_safe
    def _get_fmu_state(self) -> dict[str, Any]:
        try:
            run = dict(read_numbers(self.run, RUN_TREE), outputs_current=False)  # for outputs are calculated anew
            kept = {"run": run, "origin": __name__, "invalid_values": dict(self.invalid_values)}
            return kept | {"model": read_numbers(self.model, self.attribute_tree)}
        except BaseException as error:  # as in hosted.py
            self.handle_exception(error)
            return {}

    @classmethod
    @signal_safe
    def _fmu_state_to_bytes(cls, state: object) -> bytes:
        try:
            return to_bytes(state)
        except BaseException:
            cls.compensate_references()
            raise

    @classmethod
    @signal_safe
    def _fmu_state_from_bytes(cls, content: bytes) -> Any:
        try:
            state = from_bytes(content)
            if state is None or not cls.is_own_state(state, content):
                write_to_stderr(f"{cls.__name__}: {INVALID_STATE_MESSAGE}")
                raise InvalidStateError
            return state
        except BaseException:
            cls.compensate_references()
            raise

    @classmethod
    def compensate_references(cls) -> None:
        """Pay for an exception that leaves a method of the class; which instance will be let go is not told."""
        for slave in cls.instances:
            add_references(slave, slave._get_log_queue())
        add_references(cls)

    @classmethod
    def is_own_state(cls, state: dict[str, Any], content: bytes) -> bool:
        """Whether an instance can be in a state, and would write it so."""
        spare = cls.plain_class(instance_name="")
        cls.instances.discard(spare)
        try:
            if not matches_pattern(dict(state, invalid_values={}), spare._get_fmu_state()):
                return False
            spare.restore(state)
            return spare.is_valid() and to_bytes(spare._get_fmu_state()) == content
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return False

    def is_valid(self) -> bool:
        """Whether run, settings and sentences are such as can come about."""
        names = {UNKNOWN_NAME, *(name for name, _ in self.variables)}
        return (
            call_sequence.is_valid_state(self.run, self.model, False)
            and self.run.n_invalid_values == len(self.invalid_values)
            and names.issuperset(self.invalid_values)
            and all(type(text) is str and text == sanitize(text) for text in self.invalid_values.values())
            and all(
                declared.accepts(getattr(thing, name))
                for (_, declared), (thing, name) in zip(self.variables, self.attribute_owners)
                if declared.causality in SETTABLE_CAUSALITIES or declared.type != "Real"
            )
        )

    @signal_safe
    def _set_fmu_state(self, state: Any) -> None:
        try:
            own = type(state) is dict and state.get("origin") == __name__
            if own:
                self.restore(state)
        except BaseException as error:  # as in hosted.py
            self.handle_exception(error)
        else:
            if not own:
                write_to_stderr(f"{type(self).__name__} ({self.instance_name}): {INVALID_STATE_MESSAGE}")
                add_references(self, self._get_log_queue(), type(self))
                raise InvalidStateError

    def restore(self, state: dict[str, Any]) -> None:
        """Take over a state that has been found good."""
        write_numbers(self.run, RUN_TREE, state["run"])
        self.invalid_values = dict(state["invalid_values"])
        write_numbers(self.model, self.attribute_tree, state["model"])
        if self.run.has_failed:
            self.set_outputs_to_nan()
