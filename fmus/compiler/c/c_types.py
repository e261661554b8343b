"""Types of values in the numerics and their C spelling."""

import inspect
from dataclasses import dataclass
from math import copysign, inf
from types import FunctionType
from typing import TypeAlias

from ..model_lookup import FMUS


@dataclass(frozen=True)
class Scalar:
    """A number that is known at run time only."""

    name: str  # in Python
    c: str


FLOAT, INT, BOOL = Scalar("float", "double"), Scalar("int", "int64_t"), Scalar("bool", "bool")


@dataclass(frozen=True)
class FloatArray:
    """A list of floats of fixed length."""

    length: int


@dataclass(frozen=True)
class ScalarTuple:
    """The numbers of a tuple that a function returns; a struct in C."""

    parts: tuple[Scalar, ...]

    @property
    def c(self) -> str:
        return "struct group_" + "".join(part.c[0] for part in self.parts)


@dataclass(frozen=True)
class StructPointer:
    """An object that the model owns; in C, a pointer to the struct of its class."""

    cls: type

    @property
    def c(self) -> str:
        return f"struct {self.cls.__name__} *"


@dataclass(frozen=True)
class CompileTimeValue:
    """A value known during translation: a number, a function, a class or a module."""

    value: object


@dataclass(frozen=True)
class BoundMethod:
    """A method and the object that it is called on."""

    function: FunctionType
    owner: str  # C text of the pointer
    cls: type


@dataclass(frozen=True)
class CFunction:
    """A translated function: C name, result type, whether it has no side effects and whether it can fault."""

    name: str
    result: "CType | None"
    is_pure: bool
    can_fault: bool


CType: TypeAlias = Scalar | FloatArray | ScalarTuple | StructPointer | CompileTimeValue | BoundMethod


def scalar_type_of(value: object) -> Scalar | None:
    """Return the type of a Python number, or None for other values."""
    return {float: FLOAT, int: INT, bool: BOOL}.get(type(value))


def c_spelling(ctype: CType | None) -> str:
    """Return the C spelling of a type."""
    return (
        "void" if ctype is None else ctype.c if isinstance(ctype, (Scalar, ScalarTuple, StructPointer)) else "double *"
    )


def c_declaration(ctype: CType, name: str) -> str:
    """Return the declaration of a variable or parameter."""
    c = c_spelling(ctype)
    return f"{c}{name}" if c.endswith("*") else f"{c} {name}"


def c_literal(value: object) -> str:
    """Return a Python number as a C literal."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return repr(value)
    assert isinstance(value, float)
    if value != value:
        return "NAN"
    if value in (inf, -inf):
        return "INFINITY" if value > 0.0 else "MINUS_INFINITY"
    return "-0.0" if value == 0.0 and copysign(1.0, value) < 0.0 else repr(value)


def source_location(function: FunctionType, line: int = 0) -> str:
    """Return file and line of a function, or the given line of its file, independent of the machine."""
    file = inspect.getsourcefile(function) or "?"
    path = file.removeprefix(f"{FMUS.parent}/") if file.startswith(str(FMUS)) else file.rsplit("/", 1)[-1]
    return f"{path}:{line or function.__code__.co_firstlineno}"
