"""Saved states: what one holds, what its bytes are (a checksum, then JSON), and whether they may be taken over."""

from __future__ import annotations

import json
from binascii import crc32
from typing import Any
from weakref import WeakSet

from . import rules
from .boundary import announce, guarded, pay, printable
from .codes import FOREIGN_STATE
from .sentences import CALLS
from .values import NOWHERE, SETTABLE, Values

Shape = dict[str, Any]  # the name of every number with None, and of every object with the shape of that

LONGEST = 1 << 20  # bytes; a state has some thousand
DEEPEST = 400  # brackets: what they nest must not overflow the parser
WIDEST = 1 << 63  # integers are those of C

REFUSED = CALLS[FOREIGN_STATE]


def sealed(state: object) -> bytes:
    """The bytes of a state."""
    text = json.dumps(state).encode()
    return b"%08x" % crc32(text) + text


def unsealed(content: bytes) -> Any:
    """What the bytes hold, or None where they cannot be a state."""
    seal, text = content[:8], content[8:]
    if len(text) > LONGEST or seal != b"%08x" % crc32(text) or text.count(b"[") + text.count(b"{") > DEEPEST:
        return None
    try:
        return json.loads(text, parse_int=integer)
    except (ValueError, RecursionError):
        return None


def integer(text: str) -> int:
    """As int, which takes minutes for a million digits."""
    return int(text[:20])


def fits(value: Any, pattern: Any) -> bool:
    """Whether a value has the very names, types and lengths of the pattern."""
    if type(value) is not type(pattern):
        return False
    if type(value) is dict:
        return list(value) == list(pattern) and all(fits(value[name], pattern[name]) for name in pattern)
    if type(value) is list:
        return len(value) == len(pattern) and all(map(fits, value, pattern))
    return type(value) is not int or -WIDEST <= value < WIDEST


def shape(thing: object) -> Shape:
    """The name of every number of an object with None, and of every object it owns with the shape of that."""
    return {name: shape(value) if hasattr(value, "__dict__") else None for name, value in vars(thing).items()}


def numbers(thing: object, names: Shape) -> dict[str, Any]:
    """All numbers of an object and of the objects it owns, as its shape names them: a flat copy that JSON can hold."""
    kept = {}
    for name, inner in names.items():
        value = getattr(thing, name)
        kept[name] = numbers(value, inner) if inner is not None else list(value) if isinstance(value, list) else value
    return kept


def take_over(thing: object, names: Shape, kept: dict[str, Any]) -> None:
    """Put the numbers back, under the names of the shape and no others."""
    for name, inner in names.items():
        value = kept[name]
        if inner is not None:
            take_over(getattr(thing, name), inner, value)
        else:
            setattr(thing, name, list(value) if isinstance(value, list) else value)


RUN = shape(rules.Run(0.0))


class Foreign(ValueError):
    """What is not a saved state of this FMU; the layer tells the host what it reads here."""

    def __repr__(self) -> str:
        return REFUSED


class Saved(Values):
    """The part of an instance that saves and restores its state."""

    # of the subclass that hosting() makes
    shape: Shape
    living: WeakSet[Any]
    bare: Any

    @guarded
    def _get_fmu_state(self) -> dict[str, Any]:
        try:
            run = dict(numbers(self.run, RUN), observed=False)  # for outputs are calculated anew
            kept = {"run": run, "origin": __name__, "refused": dict(self.refused)}
            return kept | {"model": numbers(self.model, self.shape)}
        except BaseException as error:  # as in hosted.py
            self.rescue(error)
            return {}

    @classmethod
    @guarded
    def _fmu_state_to_bytes(cls, state: object) -> bytes:
        try:
            return sealed(state)
        except BaseException:
            cls.pay_up()
            raise

    @classmethod
    @guarded
    def _fmu_state_from_bytes(cls, content: bytes) -> Any:
        try:
            state = unsealed(content)
            if state is None or not cls.is_own(state, content):
                announce(f"{cls.__name__}: {REFUSED}")
                raise Foreign
            return state
        except BaseException:
            cls.pay_up()
            raise

    @classmethod
    def pay_up(cls) -> None:
        """Pay for an exception that leaves a method of the class; which instance will be let go is not told."""
        for slave in cls.living:
            pay(slave, slave._get_log_queue())
        pay(cls)

    @classmethod
    def is_own(cls, state: dict[str, Any], content: bytes) -> bool:
        """Whether an instance can be in a state, and would write it so."""
        spare = cls.bare(instance_name="")
        cls.living.discard(spare)
        try:
            if not fits(dict(state, refused={}), spare._get_fmu_state()):
                return False
            spare.be(state)
            return spare.is_sound() and sealed(spare._get_fmu_state()) == content
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return False

    def is_sound(self) -> bool:
        """Whether run, settings and sentences are such as can come about."""
        names = {NOWHERE, *(name for name, _ in self.variables)}
        return (
            rules.is_sound(self.run, self.model, False)
            and self.run.refused == len(self.refused)
            and names.issuperset(self.refused)
            and all(type(text) is str and text == printable(text) for text in self.refused.values())
            and all(
                declared.accepts(getattr(thing, name))
                for (_, declared), (thing, name) in zip(self.variables, self.owners)
                if declared.causality in SETTABLE or declared.type != "Real"
            )
        )

    @guarded
    def _set_fmu_state(self, state: Any) -> None:
        try:
            own = type(state) is dict and state.get("origin") == __name__
            if own:
                self.be(state)
        except BaseException as error:  # as in hosted.py
            self.rescue(error)
        else:
            if not own:
                announce(f"{type(self).__name__} ({self.instance_name}): {REFUSED}")
                pay(self, self._get_log_queue(), type(self))
                raise Foreign

    def be(self, state: dict[str, Any]) -> None:
        """Take over a state that has been found good."""
        take_over(self.run, RUN, state["run"])
        self.refused = dict(state["refused"])
        take_over(self.model, self.shape, state["model"])
        if self.run.failed:
            self.silence()
