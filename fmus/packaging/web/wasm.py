"""Compiles the C sources of a native FMU to WebAssembly for the browser."""

from base64 import b64encode
from collections.abc import Mapping
from gzip import compress

from ..native.compiler import compile_and_link
from ..native.sources import MAIN_SOURCE

TARGET = "wasm32-wasi"
EXPORTED = (  # called by script/fmu.js
    *("fmi2Instantiate", "fmi2Reset", "fmi2SetupExperiment"),
    *("fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2DoStep"),
    *("fmi2GetReal", "fmi2GetInteger", "fmi2SetReal", "fmi2SetInteger"),
)
# Headers of a C library without the library itself, which the compiler would have to build first: script/libc.js
# implements the functions.
HEADERS = [f"-isystem{{compiler}}/lib/libc/include/{kind}-musl" for kind in ("wasm-wasi", "generic")]
LINK_OPTIONS = ("-Wl,--no-entry", "-Wl,--import-symbols", *(f"-Wl,--export={name}" for name in EXPORTED))
OPTIONS = ("-nostdlib", *HEADERS, *LINK_OPTIONS, "-fvisibility=hidden")


def compile_to_base64(name: str, files: Mapping[str, str]) -> str:
    """Compile an FMU to WebAssembly; return it compressed and base64-encoded."""
    return b64encode(
        compress(compile_and_link(files, MAIN_SOURCE["2"], TARGET, f"{name}.wasm", OPTIONS), mtime=0)
    ).decode()
