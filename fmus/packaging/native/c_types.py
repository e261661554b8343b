"""What a name may stand for in the numerics, and how C spells it."""

from dataclasses import dataclass
from math import copysign, inf
from types import FunctionType
from typing import TypeAlias


@dataclass(frozen=True)
class Scalar:
    """A number that lives at run time."""

    name: str  # in Python
    c: str


FLOAT, INT, BOOL = Scalar("float", "double"), Scalar("int", "int64_t"), Scalar("bool", "bool")


@dataclass(frozen=True)
class FloatArray:
    """A list of floats, of fixed length."""

    length: int


@dataclass(frozen=True)
class ScalarTuple:
    """The numbers that a function returns together."""

    parts: tuple[Scalar, ...]

    @property
    def c(self) -> str:
        return "struct group_" + "".join(part.c[0] for part in self.parts)


@dataclass(frozen=True)
class StructPointer:
    """An object that the model owns, known by its class; at run time a pointer to its struct."""

    cls: type

    @property
    def c(self) -> str:
        return f"struct {self.cls.__name__} *"


@dataclass(frozen=True)
class CompileTimeValue:
    """Known while compiling: a number, a function, a class, a module."""

    value: object


@dataclass(frozen=True)
class BoundMethod:
    """A function with the object that it is called on."""

    function: FunctionType
    owner: str  # the pointer, as C text
    cls: type


CType: TypeAlias = Scalar | FloatArray | ScalarTuple | StructPointer | CompileTimeValue | BoundMethod


def scalar_type_of(value: object) -> Scalar | None:
    """The kind of a Python number; None for anything else."""
    return {float: FLOAT, int: INT, bool: BOOL}.get(type(value))


def c_spelling(ctype: CType | None) -> str:
    """The C type of a variable or a result."""
    return (
        "void" if ctype is None else ctype.c if isinstance(ctype, (Scalar, ScalarTuple, StructPointer)) else "double *"
    )


def c_declaration(ctype: CType, name: str) -> str:
    """The declaration of a variable or a parameter."""
    c = c_spelling(ctype)
    return f"{c}{name}" if c.endswith("*") else f"{c} {name}"


def c_literal(value: object) -> str:
    """A Python number as C reads it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return repr(value)
    assert isinstance(value, float)
    if value != value:
        return "NAN"
    if value in (inf, -inf):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return "-0.0" if value == 0.0 and copysign(1.0, value) < 0.0 else repr(value)
