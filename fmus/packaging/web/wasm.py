"""The native FMU of a model for the browser: the same C sources, as WebAssembly."""

from base64 import b64encode
from collections.abc import Mapping
from gzip import compress

from ..native.compiler import linked
from ..native.sources import COMPILED

TARGET = "wasm32-wasi"
CALLED = (  # by script/fmu.js
    *("malloc", "fmi2Instantiate", "fmi2Reset", "fmi2SetupExperiment"),
    *("fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2DoStep"),
    *("fmi2GetReal", "fmi2GetInteger", "fmi2SetReal", "fmi2SetInteger"),
)
OPTIONS = ("-mexec-model=reactor", "-fvisibility=hidden", *(f"-Wl,--export={name}" for name in CALLED))


def packed(name: str, files: Mapping[str, str]) -> str:
    """The WebAssembly of the FMU `name` from its sources, compressed, in letters."""
    return b64encode(compress(linked(files, COMPILED["2"], TARGET, f"{name}.wasm", OPTIONS), mtime=0)).decode()
