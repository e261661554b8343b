"""Encodes the binary format of WebAssembly components: sections, types and functions.

The format: https://github.com/WebAssembly/component-model/blob/main/design/mvp/Binary.md
"""

import re
from collections.abc import Iterable, Mapping

PRIMITIVES = {
    **{"bool": 0x7F, "s8": 0x7E, "u8": 0x7D, "s16": 0x7C, "u16": 0x7B, "s32": 0x7A, "u32": 0x79, "s64": 0x78},
    **{"u64": 0x77, "f32": 0x76, "f64": 0x75, "string": 0x73},
}
RECORD, LIST, TUPLE, ENUM, OPTION, RESULT, OWN, BORROW = 0x72, 0x70, 0x6F, 0x6D, 0x6B, 0x6A, 0x69, 0x68
FUNC, TYPE, COMPONENT, INSTANCE = b"\x01", b"\x03", b"\x04", b"\x05"  # sorts
CORE_FUNC, CORE_MEMORY, CORE_INSTANCE = b"\x00\x00", b"\x00\x02", b"\x12"
CORE_MODULE_SECTION, CORE_INSTANCE_SECTION, COMPONENT_SECTION, INSTANCE_SECTION = 1, 2, 4, 5
ALIAS_SECTION, TYPE_SECTION, CANON_SECTION, IMPORT_SECTION, EXPORT_SECTION = 6, 7, 8, 10, 11
UTF8, MEMORY, REALLOC, POST_RETURN = b"\x00", b"\x03", b"\x04", b"\x05"  # options of canonical functions
PREAMBLE = b"\0asm\x0d\x00\x01\x00"
CORE_PREAMBLE = b"\0asm\x01\x00\x00\x00"


def uleb(number: int) -> bytes:
    """Encode a number that is not negative in LEB128."""
    encoded = bytearray()
    while number >= 0x80:
        encoded.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes((*encoded, number))


def type_index(index: int) -> bytes:
    """Encode the index of a type as a value type: signed LEB128, in which primitive types are negative."""
    encoded = uleb(index)
    return encoded if encoded[-1] < 0x40 else encoded[:-1] + bytes((encoded[-1] | 0x80, 0))


def vector(items: Iterable[bytes]) -> bytes:
    """Encode items with their number in front."""
    encoded = list(items)
    return uleb(len(encoded)) + b"".join(encoded)


def text(name: str) -> bytes:
    """Encode a string."""
    return uleb(len(name.encode())) + name.encode()


def extern_name(name: str) -> bytes:
    """Encode the name of an import or export."""
    return b"\x00" + text(name)


def section(number: int, content: bytes) -> bytes:
    """Encode a section of a component or of a core module."""
    return bytes((number,)) + uleb(len(content)) + content


def split_arguments(arguments: str) -> list[str]:
    """Split text at the commas that are outside angle brackets."""
    parts = re.findall(r"(?:[^,<>]|<(?:[^<>]|<(?:[^<>]|<[^<>]*>)*>)*>)+", arguments)
    return [part.strip() for part in parts]


def parse_signature(signature: str) -> tuple[str, list[tuple[str, str]], str]:
    """Return name, names and types of the parameters, and type of the result ("" for none) of a function."""
    head, _, result = signature.partition(" -> ")
    name, _, parameters = head.rstrip(")").partition("(")
    pairs = [part.partition(": ")[::2] for part in split_arguments(parameters)]
    return name, [(label, kind) for label, kind in pairs], result


class TypeScope:
    """Index space of types, in a component or an instance type; `names` has the indices of named types."""

    def __init__(self) -> None:
        self.content = b""
        self.n_declarations = self.n_types = 0
        self.names: dict[str, int] = {}
        self._defined: dict[bytes, int] = {}

    def add_type(self, definition: bytes) -> None:
        """Append a definition."""
        raise NotImplementedError

    def define(self, definition: bytes) -> int:
        """Return the index of a definition; an equal one is used again."""
        if definition not in self._defined:
            self.add_type(definition)
            self._defined[definition] = self.new_type()
        return self._defined[definition]

    def new_type(self) -> int:
        """Return the index of a type that was appended."""
        self.n_types += 1
        return self.n_types - 1

    def value_type(self, expression: str) -> bytes:
        """Encode a type expression of WIT, such as list<u32>; compound types without a name are defined."""
        if expression in PRIMITIVES:
            return bytes((PRIMITIVES[expression],))
        if expression in self.names:
            return type_index(self.names[expression])
        return type_index(self.define(self.definition(expression)))

    def definition(self, expression: str) -> bytes:
        """Encode the definition of a type."""
        if expression in PRIMITIVES:
            return bytes((PRIMITIVES[expression],))
        head, _, inner = expression.partition("<")
        arguments = split_arguments(inner.removesuffix(">"))
        if head == "record":
            fields = [argument.partition(": ")[::2] for argument in arguments]
            return bytes((RECORD,)) + vector(text(label) + self.value_type(kind) for label, kind in fields)
        if head == "enum":
            return bytes((ENUM,)) + vector(map(text, arguments))
        if head in ("own", "borrow"):
            return bytes((OWN if head == "own" else BORROW,)) + uleb(self.names[arguments[0]])
        kinds = [self.value_type(argument) for argument in arguments]
        if head == "tuple":
            return bytes((TUPLE,)) + vector(kinds)
        if head == "result":
            return bytes((RESULT,)) + b"".join(b"\x01" + kind for kind in kinds)
        return bytes(({"list": LIST, "option": OPTION}[head],)) + kinds[0]

    def function_type(self, parameters: Iterable[tuple[str, str]], result: str) -> int:
        """Return the index of a function type."""
        encoded = vector(text(label) + self.value_type(kind) for label, kind in parameters)
        return self.define(b"\x40" + encoded + (b"\x00" + self.value_type(result) if result else b"\x01\x00"))


class InstanceType(TypeScope):
    """Type of an instance: types and functions that it exports."""

    def _declare(self, declaration: bytes) -> None:
        self.content += declaration
        self.n_declarations += 1

    def add_type(self, definition: bytes) -> None:
        self._declare(b"\x01" + definition)

    def export_type(self, name: str, index: int) -> None:
        """Export a type; from here on its name means the exported type."""
        self._declare(b"\x04" + extern_name(name) + b"\x03\x00" + uleb(index))
        self.names[name] = self.new_type()

    def alias_outer_type(self, index: int) -> int:
        """Return the index of a type of the component around this type."""
        self._declare(b"\x02\x03\x02\x01" + uleb(index))
        return self.new_type()

    def export_function(self, name: str, index: int) -> None:
        """Export a function of a type."""
        self._declare(b"\x04" + extern_name(name) + FUNC + uleb(index))

    def encode(self) -> bytes:
        """Return the definition of the type."""
        return b"\x42" + uleb(self.n_declarations) + self.content


class Component(TypeScope):
    """A component. Methods append a section and return the index of what it defines, in the order of their calls."""

    def __init__(self) -> None:
        super().__init__()
        self._counts = dict.fromkeys(("core module", "core instance", "core func", "func", "instance", "component"), 0)

    def _append(self, number: int, item: bytes, kind: str) -> int:
        self.content += section(number, b"\x01" + item)
        self._counts[kind] += 1
        return self._counts[kind] - 1

    def add_type(self, definition: bytes) -> None:
        self.content += section(TYPE_SECTION, b"\x01" + definition)

    def add_resource(self, destructor: int) -> int:
        """Define a resource, whose representation is an i32, with a core function as destructor."""
        self.add_type(b"\x3f\x7f\x01" + uleb(destructor))
        return self.new_type()

    def import_type(self, name: str, index: int | None) -> int:
        """Import a type that is equal to another one, or a resource."""
        bound = b"\x01" if index is None else b"\x00" + uleb(index)
        self.content += section(IMPORT_SECTION, b"\x01" + extern_name(name) + TYPE + bound)
        return self.new_type()

    def import_function(self, name: str, index: int) -> int:
        """Import a function of a type."""
        return self._append(IMPORT_SECTION, extern_name(name) + FUNC + uleb(index), "func")

    def import_instance(self, name: str, index: int) -> int:
        """Import an instance of a type."""
        return self._append(IMPORT_SECTION, extern_name(name) + INSTANCE + uleb(index), "instance")

    def export_type(self, name: str, index: int) -> None:
        """Export a type; from here on its name means the exported type."""
        self.content += section(EXPORT_SECTION, b"\x01" + extern_name(name) + TYPE + uleb(index) + b"\x00")
        self.names[name] = self.new_type()

    def export_function(self, name: str, function: int, index: int) -> None:
        """Export a function with a type."""
        item = extern_name(name) + FUNC + uleb(function) + b"\x01" + FUNC + uleb(index)
        self._append(EXPORT_SECTION, item, "func")

    def export_instance(self, name: str, instance: int) -> None:
        """Export an instance."""
        self._append(EXPORT_SECTION, extern_name(name) + INSTANCE + uleb(instance) + b"\x00", "instance")

    def alias_type(self, instance: int, name: str) -> int:
        """Return the index of a type that an instance exports."""
        self.content += section(ALIAS_SECTION, b"\x01" + TYPE + b"\x00" + uleb(instance) + text(name))
        return self.new_type()

    def alias_function(self, instance: int, name: str) -> int:
        """Return the index of a function that an instance exports."""
        return self._append(ALIAS_SECTION, FUNC + b"\x00" + uleb(instance) + text(name), "func")

    def alias_core_function(self, instance: int, name: str) -> int:
        """Return the index of a core function that a core instance exports."""
        return self._append(ALIAS_SECTION, CORE_FUNC + b"\x01" + uleb(instance) + text(name), "core func")

    def alias_core_memory(self, instance: int, name: str) -> None:
        """Name the memory that a core instance exports: the memory 0 of the component."""
        self.content += section(ALIAS_SECTION, b"\x01" + CORE_MEMORY + b"\x01" + uleb(instance) + text(name))

    def add_core_module(self, module: bytes) -> int:
        """Embed a core module."""
        self.content += section(CORE_MODULE_SECTION, module)
        self._counts["core module"] += 1
        return self._counts["core module"] - 1

    def add_component(self, component: "Component") -> int:
        """Embed a component."""
        self.content += section(COMPONENT_SECTION, component.encode())
        self._counts["component"] += 1
        return self._counts["component"] - 1

    def instantiate_core(self, module: int, arguments: Mapping[str, int]) -> int:
        """Instantiate a core module with core instances."""
        given = vector(text(name) + CORE_INSTANCE + uleb(instance) for name, instance in arguments.items())
        return self._append(CORE_INSTANCE_SECTION, b"\x00" + uleb(module) + given, "core instance")

    def bundle_core_functions(self, functions: Mapping[str, int]) -> int:
        """Combine core functions to a core instance."""
        exports = vector(text(name) + b"\x00" + uleb(function) for name, function in functions.items())
        return self._append(CORE_INSTANCE_SECTION, b"\x01" + exports, "core instance")

    def instantiate(self, component: int, types: Mapping[str, int], functions: Mapping[str, int]) -> int:
        """Instantiate a component with types and functions."""
        arguments = [text(name) + TYPE + uleb(index) for name, index in types.items()]
        arguments += [text(name) + FUNC + uleb(index) for name, index in functions.items()]
        return self._append(INSTANCE_SECTION, b"\x00" + uleb(component) + vector(arguments), "instance")

    def lower(self, function: int) -> int:
        """Return a core function that calls a function whose strings are in memory 0."""
        return self._append(CANON_SECTION, b"\x01\x00" + uleb(function) + vector((UTF8, MEMORY + b"\x00")), "core func")

    def lift(self, core_function: int, index: int, realloc: int, post_return: int) -> int:
        """Return a function of a type that calls a core function, with arguments and results in memory 0."""
        options = vector((UTF8, MEMORY + b"\x00", REALLOC + uleb(realloc), POST_RETURN + uleb(post_return)))
        return self._append(CANON_SECTION, b"\x00\x00" + uleb(core_function) + options + uleb(index), "func")

    def resource_new(self, resource: int) -> int:
        """Return a core function that creates a handle of a resource."""
        return self._append(CANON_SECTION, b"\x02" + uleb(resource), "core func")

    def encode(self) -> bytes:
        """Return the component."""
        return PREAMBLE + self.content
