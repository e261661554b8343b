"""Builds the WebAssembly component of an FMU.

The component holds three core modules: one with the memory, the FMU (component.c), and one that turns the address of a
new instance into a handle of the component model. The first exists because the function that logs messages needs a
memory before the FMU is instantiated, the last because a handle needs the function of the FMU that frees an instance.
"""

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from ...certified_result import NAMESPACE
from ...text_output import xml_bytes
from ..compiler import compile_and_link
from .encoder import (
    CORE_PREAMBLE,
    Component,
    InstanceType,
    parse_signature,
    section,
    text,
    uleb,
    vector,
)
from .interfaces import (
    FUNCTIONS,
    GET_VERSION,
    LAYERED_STANDARD,
    LOG_MESSAGE,
    PACKAGE,
    RECORDS,
    TYPES,
    VERSION,
)

TARGET, MAIN_SOURCE = "wasm32-wasi", "component.c"
PAGES = 64  # of 64 kB, at the start
STACK_SIZE = 1 << 18
OPTIONS = (
    *("-mexec-model=reactor", "-fvisibility=hidden", "-Wl,--import-memory"),
    *(f"-Wl,--initial-memory={PAGES << 16}", f"-Wl,-z,stack-size={STACK_SIZE}", "-Wl,--no-entry"),
)
I32, VOID = b"\x7f", b"\x40"
LOCAL_GET, LOCAL_TEE, CALL, IF, END = b"\x20", b"\x22", b"\x10", b"\x04", b"\x0b"
LOAD_BYTE, LOAD, STORE = b"\x2d\x00\x00", b"\x28\x02\x04", b"\x36\x02\x04"  # the flag; the address 4 bytes behind it


def build_component(name: str, files: Mapping[str, str]) -> bytes:
    """Compile the sources of an FMU for FMI 3.0 to a component for co-simulation and model exchange."""
    own = Path(__file__).with_name(MAIN_SOURCE).read_text(encoding="utf-8")
    return encode_component(compile_and_link({**files, MAIN_SOURCE: own}, MAIN_SOURCE, TARGET, f"{name}.wasm", OPTIONS))


def manifest() -> bytes:
    """Return the manifest of the layered standard."""
    values = {f"fmi-ls:fmi-ls-{key}": value for key, value in LAYERED_STANDARD.items()}
    return xml_bytes(Element("fmiLayeredStandardManifest", {"xmlns:fmi-ls": NAMESPACE} | values))


def qualified(interface: str) -> str:
    """Return the full name of an interface."""
    return f"{PACKAGE}/{interface}@{VERSION}"


def encode_component(fmu: bytes) -> bytes:
    """Return the component with the core module of an FMU."""
    root = Component()
    import_types(root)
    log_message = import_callbacks(root)
    memory = root.instantiate_core(root.add_core_module(memory_module()), {})
    root.alias_core_memory(memory, "memory")
    callbacks = root.bundle_core_functions({"log-message": root.lower(log_message)})
    main = root.instantiate_core(root.add_core_module(fmu), {"env": memory, "callbacks": callbacks})
    realloc, release, destructor = (
        root.alias_core_function(main, name) for name in ("allocate", "release", "free-instance")
    )
    resources = {interface: root.add_resource(destructor) for interface in FUNCTIONS}
    creators = {f"new-{interface}": root.resource_new(resource) for interface, resource in resources.items()}
    given = {"memory": memory, "fmu": main, "handles": root.bundle_core_functions(creators)}
    factories = root.instantiate_core(root.add_core_module(handle_module()), given)

    def lift(name: str, index: int) -> int:
        core_function = root.alias_core_function(factories if name.startswith("instantiate") else main, name)
        return root.lift(core_function, index, realloc, release)

    name, parameters, result = parse_signature(GET_VERSION)
    functions = {name: lift(name, root.function_type(parameters, result))}
    export_interface(root, "common", {}, None, {name: (parameters, result)}, functions)
    for interface, signatures in FUNCTIONS.items():
        record, definition = RECORDS[interface]
        root.names[record] = root.define(root.definition(definition))
        root.names[f"{interface}-instance"] = resources[interface]
        methods = resource_functions(interface, signatures)
        functions = {
            name: lift(name.rpartition(".")[2], root.function_type(*signature)) for name, signature in methods.items()
        }
        types = {**TYPES, record: definition}
        export_interface(root, interface, types, f"{interface}-instance", methods, functions)
    return root.encode()


def resource_functions(interface: str, signatures: list[str]) -> dict[str, tuple[list[tuple[str, str]], str]]:
    """Return parameters and result of the functions of a resource, by their names in the component model."""
    resource, functions = f"{interface}-instance", {}
    for signature in signatures:
        name, parameters, result = parse_signature(signature)
        if name.startswith("instantiate"):
            functions[f"[static]{resource}.{name}"] = parameters, f"option<own<{resource}>>"
        else:
            functions[f"[method]{resource}.{name}"] = [("self", f"borrow<{resource}>"), *parameters], result
    return functions


def import_types(root: Component) -> None:
    """Import the interface `types`."""
    types = InstanceType()
    for name, definition in TYPES.items():
        types.export_type(name, types.define(types.definition(definition)))
    instance = root.import_instance(qualified("types"), root.define(types.encode()))
    root.names |= {name: root.alias_type(instance, name) for name in TYPES}


def import_callbacks(root: Component) -> int:
    """Import the interface `callbacks`, of which only `log-message` is used; return this function."""
    callbacks = InstanceType()
    callbacks.export_type("status", callbacks.alias_outer_type(root.names["status"]))
    name, parameters, result = parse_signature(LOG_MESSAGE)
    callbacks.export_function(name, callbacks.function_type(parameters, result))
    return root.alias_function(root.import_instance(qualified("callbacks"), root.define(callbacks.encode())), name)


def export_interface(
    root: Component,
    interface: str,
    types: Mapping[str, str],
    resource: str | None,
    signatures: Mapping[str, tuple[list[tuple[str, str]], str]],
    functions: Mapping[str, int],
) -> None:
    """Export an interface with functions of the component.

    Types of exported functions must be exported as well, with the functions.  A component inside this one does that: it
    imports types and functions, and exports them with the types of the exports.
    """
    inner = Component()
    for name, definition in types.items():
        inner.names[name] = inner.import_type(f"import-{name}", inner.define(inner.definition(definition)))
    if resource:
        inner.names[resource] = inner.import_type(f"import-{resource}", None)
    imported = {
        f"import-{name.rpartition('.')[2]}": inner.function_type(*signature) for name, signature in signatures.items()
    }
    indices = [inner.import_function(name, index) for name, index in imported.items()]
    for name in (*types, *([resource] if resource else [])):
        inner.export_type(name, inner.names[name])
    for (name, signature), function in zip(signatures.items(), indices, strict=True):
        inner.export_function(name, function, inner.function_type(*signature))
    given_types = {f"import-{name}": root.names[name] for name in (*types, *([resource] if resource else []))}
    given = dict(zip(imported, functions.values(), strict=True))
    root.export_instance(qualified(interface), root.instantiate(root.add_component(inner), given_types, given))


def memory_module() -> bytes:
    """Return a core module that exports a memory."""
    return (
        CORE_PREAMBLE + section(5, vector([b"\x00" + uleb(PAGES)])) + section(7, vector([text("memory") + b"\x02\x00"]))
    )


def count_core_parameters(signature: str) -> int:
    """Return the number of parameters in the core module, where a string or list has an address and a length."""
    _, parameters, _ = parse_signature(signature)
    return sum(2 if kind == "string" or kind.startswith("list<") else 1 for _, kind in parameters)


def handle_module() -> bytes:
    """Return a core module whose functions call instantiate-... and replace the address of an instance by a handle."""
    kinds = list(FUNCTIONS)
    counts = {kind: count_core_parameters(FUNCTIONS[kind][0]) for kind in kinds}  # of instantiate-...
    factory_types = [b"\x60" + vector([I32] * n) + vector([I32]) for n in counts.values()]
    imports = [text("memory") + text("memory") + b"\x02\x00\x00"]
    exports, bodies = [], []
    for i, kind in enumerate(kinds):
        imports.append(text("fmu") + text(f"instantiate-{kind}") + b"\x00" + uleb(i + 1))
        imports.append(text("handles") + text(f"new-{kind}") + b"\x00\x00")
        exports.append(text(f"instantiate-{kind}") + b"\x00" + uleb(2 * len(kinds) + i))
        n = counts[kind]
        result = LOCAL_GET + uleb(n)
        code = b"".join(LOCAL_GET + uleb(j) for j in range(n)) + CALL + uleb(2 * i) + LOCAL_TEE + uleb(n)
        code += LOAD_BYTE + IF + VOID + result + result + LOAD + CALL + uleb(2 * i + 1) + STORE + END + result + END
        bodies.append(vector([b"\x01" + I32]) + code)
    return (
        CORE_PREAMBLE
        + section(1, vector([b"\x60" + vector([I32]) + vector([I32]), *factory_types]))
        + section(2, vector(imports))
        + section(3, vector(uleb(i + 1) for i in range(len(kinds))))
        + section(7, vector(exports))
        + section(10, vector(uleb(len(body)) + body for body in bodies))
    )
