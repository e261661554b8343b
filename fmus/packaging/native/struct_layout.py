"""The live model object as C data: a struct for each class of object that it owns, and its initial image."""

from collections.abc import Iterator

from ..reserved_names import C_NAMES
from .c_types import FLOAT, CType, FloatArray, Scalar, StructPointer, c_declaration, c_literal, scalar_type_of
from .diagnostics import UnsupportedConstructError

EMPTY_MEMBER = "nothing"  # the member of a struct that has no other, for C has no empty ones


class StructLayout:
    """The fields of every class, owned classes first."""

    def __init__(self, model: object, *others: object) -> None:
        self.fields: dict[type, dict[str, CType]] = {}
        self._seen: set[int] = set()
        self.model, *_ = [self._add(thing, type(thing).__name__) for thing in (model, *others)]

    def _add(self, thing: object, path: str) -> StructPointer:
        if id(thing) in self._seen:
            raise UnsupportedConstructError(
                f"{path} is reached in two ways; an object is owned by one other: make it anew."
            )
        self._seen.add(id(thing))
        fields = {name: self._type_of(value, f"{path}.{name}") for name, value in vars(thing).items()}
        cls = type(thing)
        if self.fields.setdefault(cls, fields) != fields:
            raise UnsupportedConstructError(
                f"{path} has other attributes than another {cls.__name__}; give all of them in __init__."
            )
        if any(other is not cls and other.__name__ == cls.__name__ for other in self.fields):
            raise UnsupportedConstructError(f"{path}: two classes are called {cls.__name__}; rename one.")
        return StructPointer(cls)

    def _type_of(self, value: object, path: str) -> CType:
        if (name := path.rsplit(".", 1)[-1]) in C_NAMES:
            raise UnsupportedConstructError(f"{path}: {name} is a word of C; take another name.")
        if ctype := scalar_type_of(value):
            return ctype
        if isinstance(value, list) and value and all(scalar_type_of(item) is FLOAT for item in value):
            return FloatArray(len(value))
        if hasattr(value, "__dict__") and not callable(value):
            return self._add(value, path)
        raise UnsupportedConstructError(
            f"{path} is {value!r}; an attribute is a float, int, bool, list of floats or an object."
        )

    def iter_scalars(self, cls: type, prefix: str = "") -> Iterator[tuple[str, Scalar]]:
        """Dotted name and kind of every number, but for those in lists, of a class and of what it owns."""
        for name, ctype in self.fields[cls].items():
            if isinstance(ctype, StructPointer):
                yield from self.iter_scalars(ctype.cls, f"{prefix}{name}.")
            elif isinstance(ctype, Scalar):
                yield prefix + name, ctype

    def struct_definitions(self) -> str:
        """The structs."""
        texts = []
        for cls, fields in self.fields.items():
            members = (
                "".join(f"    {_member(ctype, name)};\n" for name, ctype in fields.items())
                or f"    char {EMPTY_MEMBER};\n"
            )
            texts.append(f"struct {cls.__name__} {{\n{members}}};\n")
        return "\n".join(texts)

    def initializer(self, thing: object, indent: str = "    ") -> str:
        """The initialiser of a struct with the present values of an object."""
        deeper = indent + "    "
        rows = []
        for name, ctype in self.fields[type(thing)].items():
            value = getattr(thing, name)
            if isinstance(ctype, Scalar):
                text = c_literal(value)
            elif isinstance(ctype, FloatArray):
                text = "{" + ", ".join(map(c_literal, value)) + "}"
            else:
                text = self.initializer(value, deeper)
            rows.append(f"{indent}.{name} = {text},\n")
        return "{\n" + ("".join(rows) or f"{indent}.{EMPTY_MEMBER} = 0,\n") + indent[4:] + "}"


def _member(ctype: CType, name: str) -> str:
    if isinstance(ctype, StructPointer):
        return f"struct {ctype.cls.__name__} {name}"
    return f"double {name}[{ctype.length}]" if isinstance(ctype, FloatArray) else c_declaration(ctype, name)
