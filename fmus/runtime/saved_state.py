"""Saved states of an instance: contents, serialization (checksum and JSON), and validation."""

from __future__ import annotations

import json
from binascii import crc32
from typing import Any
from weakref import WeakSet

from .codes import INVALID_STATE
from .messages import CALL_MESSAGES
from .pythonfmu_workarounds import compensate_references, signal_safe, write_to_stderr
from .variable_access import VariableAccess

AttributeTree = dict[str, Any]  # attribute name -> None for a number, subtree for an object

INT64_LIMIT = 1 << 63  # a larger integer raises in the native layer, in the code of the host

INVALID_STATE_MESSAGE = CALL_MESSAGES[INVALID_STATE]


def to_bytes(state: object) -> bytes:
    """Serialize a state."""
    text = json.dumps(state).encode()
    return b"%08x" % crc32(text) + text


def from_bytes(content: bytes) -> Any:
    """Parse a serialized state; None if it cannot be one."""
    seal, text = content[:8], content[8:]
    if seal != b"%08x" % crc32(text):
        return None
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def matches_pattern(value: Any, pattern: Any) -> bool:
    """Return whether a value has the same names, types and lengths as the pattern; another would raise in a call."""
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


class InvalidStateError(ValueError):
    """Bytes or object that is no saved state of this FMU; the native layer reports the repr."""

    def __repr__(self) -> str:
        return INVALID_STATE_MESSAGE


class SavedStateAccess(VariableAccess):
    """Mixin of an FMU instance that saves and restores its state."""

    # set by make_slave_class()
    model_tree: AttributeTree
    run_tree: AttributeTree
    instances: WeakSet[Any]
    plain_class: Any

    @signal_safe
    def _get_fmu_state(self) -> dict[str, Any]:
        try:
            # outputs are recomputed after restoring
            run = dict(read_numbers(self.run, self.run_tree), outputs_current=False)
            state = {"run": run, "origin": __name__, "invalid_values": dict(self.invalid_values)}
            return state | {"model": read_numbers(self.model, self.model_tree)}
        except BaseException as error:  # as in slave.py
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
            if state is None or not cls.is_own_state(state):
                write_to_stderr(f"{cls.__name__}: {INVALID_STATE_MESSAGE}")
                raise InvalidStateError
            return state
        except BaseException:
            compensate_references(cls, cls.instances)
            raise

    @classmethod
    def is_own_state(cls, state: Any) -> bool:
        """Return whether an instance of this FMU wrote the state; one with forged numbers is accepted as well."""
        instance = cls.plain_class(instance_name="")
        cls.instances.discard(instance)
        pattern = instance._get_fmu_state()
        try:
            pattern["invalid_values"] = dict.fromkeys(state["invalid_values"], "")
        except (LookupError, TypeError):
            return False
        return matches_pattern(state, pattern) and bool(state["origin"] == __name__)

    @signal_safe
    def _set_fmu_state(self, state: Any) -> None:
        try:
            is_own = type(state) is dict and state.get("origin") == __name__
            if is_own:
                self.restore(state)
        except BaseException as error:  # as in slave.py
            self.handle_exception(error)
        else:
            if not is_own:
                write_to_stderr(f"{type(self).__name__} ({self.instance_name}): {INVALID_STATE_MESSAGE}")
                compensate_references(type(self), [self])
                raise InvalidStateError

    def restore(self, state: dict[str, Any]) -> None:
        """Restore a valid state."""
        write_numbers(self.run, self.run_tree, state["run"])
        self.invalid_values = dict(state["invalid_values"])
        write_numbers(self.model, self.model_tree, state["model"])
        if self.run.has_failed:
            self.set_outputs_to_nan()
