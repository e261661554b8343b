"""Saved states of an instance: contents, serialization (checksum and JSON), and validation."""

from __future__ import annotations

import json
from binascii import crc32
from typing import Any
from weakref import WeakSet

from . import call_sequence
from .codes import INVALID_STATE
from .messages import CALL_MESSAGES
from .pythonfmu_workarounds import compensate_references, sanitize, signal_safe, write_to_stderr
from .variable_access import SETTABLE_CAUSALITIES, UNKNOWN_NAME, VariableAccess

AttributeTree = dict[str, Any]  # attribute name -> None for a number, subtree for an object

MAX_BYTES = 1 << 20  # typical: some thousand
MAX_NESTING = 400  # brackets in total, so that the parser cannot overflow
INT64_LIMIT = 1 << 63  # integers must fit into C

INVALID_STATE_MESSAGE = CALL_MESSAGES[INVALID_STATE]


def to_bytes(state: object) -> bytes:
    """Serialize a state."""
    text = json.dumps(state).encode()
    return b"%08x" % crc32(text) + text


def from_bytes(content: bytes) -> Any:
    """Parse a serialized state; None if it cannot be one."""
    seal, text = content[:8], content[8:]
    if len(text) > MAX_BYTES or seal != b"%08x" % crc32(text) or text.count(b"[") + text.count(b"{") > MAX_NESTING:
        return None
    try:
        return json.loads(text, parse_int=parse_integer)
    except (ValueError, RecursionError):
        return None


def parse_integer(text: str) -> int:
    """Parse an integer of limited length; int() would take minutes for a million digits."""
    return int(text[:20])


def matches_pattern(value: Any, pattern: Any) -> bool:
    """Return whether a value has the same names, types and lengths as the pattern."""
    if type(value) is not type(pattern):
        return False
    if type(value) is dict:
        return list(value) == list(pattern) and all(matches_pattern(value[name], pattern[name]) for name in pattern)
    if type(value) is list:
        return len(value) == len(pattern) and all(map(matches_pattern, value, pattern))
    return type(value) is not int or -INT64_LIMIT <= value < INT64_LIMIT


def attribute_tree(owner: object) -> AttributeTree:
    """Return the attribute tree of an object: None for each number, a subtree for each object that it owns."""
    return {name: attribute_tree(value) if hasattr(value, "__dict__") else None for name, value in vars(owner).items()}


def read_numbers(owner: object, names: AttributeTree) -> dict[str, Any]:
    """Read all numbers of an object and of the objects it owns into nested dictionaries for JSON."""
    state = {}
    for name, inner in names.items():
        value = getattr(owner, name)
        state[name] = (
            read_numbers(value, inner) if inner is not None else list(value) if isinstance(value, list) else value
        )
    return state


def write_numbers(owner: object, names: AttributeTree, state: dict[str, Any]) -> None:
    """Write numbers back to the attributes of the tree."""
    for name, inner in names.items():
        value = state[name]
        if inner is not None:
            write_numbers(getattr(owner, name), inner, value)
        else:
            setattr(owner, name, list(value) if isinstance(value, list) else value)


RUN_TREE = attribute_tree(call_sequence.RunState(0.0))


class InvalidStateError(ValueError):
    """Bytes or object that is no saved state of this FMU; the native layer reports the repr."""

    def __repr__(self) -> str:
        return INVALID_STATE_MESSAGE


class SavedStateAccess(VariableAccess):
    """Mixin of an FMU instance that saves and restores its state."""

    # set by make_fmu_class()
    attribute_tree: AttributeTree
    instances: WeakSet[Any]
    plain_class: Any

    @signal_safe
    def _get_fmu_state(self) -> dict[str, Any]:
        try:
            # outputs are recomputed after restoring
            run = dict(read_numbers(self.run, RUN_TREE), outputs_current=False)
            state = {"run": run, "origin": __name__, "invalid_values": dict(self.invalid_values)}
            return state | {"model": read_numbers(self.model, self.attribute_tree)}
        except BaseException as error:  # as in fmu_instance.py
            self.handle_exception(error)
            return {}

    @classmethod
    @signal_safe
    def _fmu_state_to_bytes(cls, state: object) -> bytes:
        try:
            return to_bytes(state)
        except BaseException:
            compensate_references(cls, cls.instances)
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
            compensate_references(cls, cls.instances)
            raise

    @classmethod
    def is_own_state(cls, state: dict[str, Any], content: bytes) -> bool:
        """Return whether an instance can have this state and would serialize it to the same bytes."""
        instance = cls.plain_class(instance_name="")
        cls.instances.discard(instance)
        try:
            if not matches_pattern(dict(state, invalid_values={}), instance._get_fmu_state()):
                return False
            instance.restore(state)
            return instance.is_valid() and to_bytes(instance._get_fmu_state()) == content
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return False

    def is_valid(self) -> bool:
        """Return whether run, settings and messages are valid."""
        names = {UNKNOWN_NAME, *(name for name, _ in self.variables)}
        return (
            call_sequence.is_valid_state(self.run, self.model, False)
            and self.run.n_invalid_values == len(self.invalid_values)
            and names.issuperset(self.invalid_values)
            and all(type(text) is str and text == sanitize(text) for text in self.invalid_values.values())
            and all(
                declared.accepts(getattr(owner, name))
                for (_, declared), (owner, name) in zip(self.variables, self.attribute_owners)
                if declared.causality in SETTABLE_CAUSALITIES or declared.type != "Real"
            )
        )

    @signal_safe
    def _set_fmu_state(self, state: Any) -> None:
        try:
            own = type(state) is dict and state.get("origin") == __name__
            if own:
                self.restore(state)
        except BaseException as error:  # as in fmu_instance.py
            self.handle_exception(error)
        else:
            if not own:
                write_to_stderr(f"{type(self).__name__} ({self.instance_name}): {INVALID_STATE_MESSAGE}")
                compensate_references(type(self), [self])
                raise InvalidStateError

    def restore(self, state: dict[str, Any]) -> None:
        """Restore a valid state."""
        write_numbers(self.run, RUN_TREE, state["run"])
        self.invalid_values = dict(state["invalid_values"])
        write_numbers(self.model, self.attribute_tree, state["model"])
        if self.run.has_failed:
            self.set_outputs_to_nan()
