"""WebAssembly components of FMUs for FMI 3.0, as FMI-LS-WASM defines them (experimental).

interfaces.py    the interfaces of the draft
component.c      the functions of the interfaces, which call those of fmi3.c
encoder.py       the binary format of components
component.py     compiles and encodes the component
"""

from .component import build_component, manifest
from .interfaces import MANIFEST_FILE, PLATFORM

__all__ = ["MANIFEST_FILE", "PLATFORM", "build_component", "manifest"]
