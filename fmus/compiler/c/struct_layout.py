"""The model object as C data: one struct per class of object, and initializers with their current values."""

from collections.abc import Iterator

from .. import BuildError
from ..equations.reserved_names import C_NAMES
from .c_types import (
    FLOAT,
    CType,
    FloatArray,
    Scalar,
    StructPointer,
    c_declaration,
    c_literal,
    scalar_type_of,
)

EMPTY_MEMBER = "nothing"  # the member of a struct without fields: C has no empty structs


class AttributeTypeError(BuildError):
    """An attribute that C structs cannot represent."""

    def __init__(self, path: str) -> None:
        super().__init__(
            f"{path} cannot be translated to C; an attribute must be a float, int, bool, list of floats, or an object "
            "of its own, with the same attributes in all objects of its class, and no keyword or macro of C."
        )


class StructLayout:
    """The fields of every class; owned classes come before their owners."""

    def __init__(self, model: object, *others: object) -> None:
        self.fields: dict[type, dict[str, CType]] = {}
        self.constant_arrays: dict[str, tuple[float, ...]] = {}  # of the module of the model, which functions read
        self._instance_ids: set[int] = set()
        self.model, *_ = [self._add(instance, type(instance).__name__) for instance in (model, *others)]

    def _add(self, instance: object, path: str) -> StructPointer:
        if id(instance) in self._instance_ids:
            raise AttributeTypeError(path)
        self._instance_ids.add(id(instance))
        fields = {name: self._type_of(value, f"{path}.{name}") for name, value in vars(instance).items()}
        cls = type(instance)
        names = [other.__name__ for other in self.fields if other is not cls]
        if self.fields.setdefault(cls, fields) != fields or cls.__name__ in names:
            raise AttributeTypeError(path)
        return StructPointer(cls)

    def _type_of(self, value: object, path: str) -> CType:
        if path.rsplit(".", 1)[-1] in C_NAMES:
            raise AttributeTypeError(path)
        if ctype := scalar_type_of(value):
            return ctype
        if isinstance(value, list) and value and all(scalar_type_of(item) is FLOAT for item in value):
            return FloatArray(len(value))
        if hasattr(value, "__dict__") and not callable(value):
            return self._add(value, path)
        raise AttributeTypeError(path)

    def iter_scalars(self, cls: type, prefix: str = "") -> Iterator[tuple[str, Scalar]]:
        """Yield dotted name and type of every number of a class and of the objects it owns, except those in lists."""
        for name, ctype in self.fields[cls].items():
            if isinstance(ctype, StructPointer):
                yield from self.iter_scalars(ctype.cls, f"{prefix}{name}.")
            elif isinstance(ctype, Scalar):
                yield prefix + name, ctype

    def struct_definitions(self) -> str:
        """Return the definitions of the structs."""
        texts = []
        for cls, fields in self.fields.items():
            members = (
                "".join(f"    {_member(ctype, name)};\n" for name, ctype in fields.items())
                or f"    char {EMPTY_MEMBER};\n"
            )
            texts.append(f"struct {cls.__name__} {{\n{members}}};\n")
        return "\n".join(texts)

    def array_definitions(self) -> str:
        """Return the definitions of the constant arrays."""
        return "".join(
            f"static const double table{name}[{len(values)}] = {{{', '.join(map(c_literal, values))}}};\n"
            for name, values in self.constant_arrays.items()
        )

    def initializer(self, instance: object, indent: str = "    ") -> str:
        """Return the initializer of a struct with the current values of an object."""
        inner_indent = indent + "    "
        lines = []
        for name, ctype in self.fields[type(instance)].items():
            value = getattr(instance, name)
            if isinstance(ctype, Scalar):
                text = c_literal(value)
            elif isinstance(ctype, FloatArray):
                text = "{" + ", ".join(map(c_literal, value)) + "}"
            else:
                text = self.initializer(value, inner_indent)
            lines.append(f"{indent}.{name} = {text},\n")
        return "{\n" + ("".join(lines) or f"{indent}.{EMPTY_MEMBER} = 0,\n") + indent[4:] + "}"


def _member(ctype: CType, name: str) -> str:
    if isinstance(ctype, StructPointer):
        return f"struct {ctype.cls.__name__} {name}"
    return f"double {name}[{ctype.length}]" if isinstance(ctype, FloatArray) else c_declaration(ctype, name)
