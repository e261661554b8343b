"""The live model object as C data: a struct for each class of object that it owns, and its initial image."""

from collections.abc import Iterator

from ..reserved_names import C_NAMES
from .kinds import FLOAT, Kind, Object, Row, Scalar, declare, kind_of, literal
from .refusal import Refused

NOTHING = "nothing"  # the member of a struct that has no other, for C has no empty ones


class Layout:
    """The fields of every class, owned classes first."""

    def __init__(self, model: object, *others: object) -> None:
        self.fields: dict[type, dict[str, Kind]] = {}
        self._seen: set[int] = set()
        self.model, *_ = [self._add(thing, type(thing).__name__) for thing in (model, *others)]

    def _add(self, thing: object, path: str) -> Object:
        if id(thing) in self._seen:
            raise Refused(f"{path} is reached in two ways; an object is owned by one other: make it anew.")
        self._seen.add(id(thing))
        fields = {name: self._kind(value, f"{path}.{name}") for name, value in vars(thing).items()}
        cls = type(thing)
        if self.fields.setdefault(cls, fields) != fields:
            raise Refused(f"{path} has other attributes than another {cls.__name__}; give all of them in __init__.")
        if any(other is not cls and other.__name__ == cls.__name__ for other in self.fields):
            raise Refused(f"{path}: two classes are called {cls.__name__}; rename one.")
        return Object(cls)

    def _kind(self, value: object, path: str) -> Kind:
        if (name := path.rsplit(".", 1)[-1]) in C_NAMES:
            raise Refused(f"{path}: {name} is a word of C; take another name.")
        if kind := kind_of(value):
            return kind
        if isinstance(value, list) and value and all(kind_of(item) is FLOAT for item in value):
            return Row(len(value))
        if hasattr(value, "__dict__") and not callable(value):
            return self._add(value, path)
        raise Refused(f"{path} is {value!r}; an attribute is a float, int, bool, list of floats or an object.")

    def scalars(self, cls: type, prefix: str = "") -> Iterator[tuple[str, Scalar]]:
        """Dotted name and kind of every number, but for those in lists, of a class and of what it owns."""
        for name, kind in self.fields[cls].items():
            if isinstance(kind, Object):
                yield from self.scalars(kind.cls, f"{prefix}{name}.")
            elif isinstance(kind, Scalar):
                yield prefix + name, kind

    def definitions(self) -> str:
        """The structs."""
        texts = []
        for cls, fields in self.fields.items():
            members = (
                "".join(f"    {_member(kind, name)};\n" for name, kind in fields.items()) or f"    char {NOTHING};\n"
            )
            texts.append(f"struct {cls.__name__} {{\n{members}}};\n")
        return "\n".join(texts)

    def image(self, thing: object, indent: str = "    ") -> str:
        """The initialiser of a struct with the present values of an object."""
        deeper = indent + "    "
        rows = []
        for name, kind in self.fields[type(thing)].items():
            value = getattr(thing, name)
            if isinstance(kind, Scalar):
                text = literal(value)
            elif isinstance(kind, Row):
                text = "{" + ", ".join(map(literal, value)) + "}"
            else:
                text = self.image(value, deeper)
            rows.append(f"{indent}.{name} = {text},\n")
        return "{\n" + ("".join(rows) or f"{indent}.{NOTHING} = 0,\n") + indent[4:] + "}"


def _member(kind: Kind, name: str) -> str:
    if isinstance(kind, Object):
        return f"struct {kind.cls.__name__} {name}"
    return f"double {name}[{kind.length}]" if isinstance(kind, Row) else declare(kind, name)
