"""Workarounds for memory errors in the native layer of pythonfmu 0.7.0; embedded in every Python FMU.

1. Every instance releases a borrowed reference to the globals of the entry script.  Without countermeasure the second
   instance frees them.  Each run of the script therefore takes one extra reference.
2. At process exit a library that is still loaded releases its state in a static destructor, and again through the
   dangling pointer, which sometimes ends in "corrupted double-linked list" (seen with valgrind).
   `finalizePythonInterpreter` clears the pointer; called while Python still runs, it makes the later releases no-ops.
   The library is not kept loaded for this: a host that unloads it gets its memory back.
3. Every instance prepends an entry to sys.path, which is not needed after the script has run.
"""

import atexit
import os
import sys
from contextlib import suppress
from ctypes import PYFUNCTYPE, PyDLL, c_void_p, cast
from glob import escape, glob
from typing import Any

kept_references: list[object] = []
finalizers: dict[str, Any] = {}  # path -> address of its finalizePythonInterpreter


def keep_reference(names: dict[str, str]) -> None:
    """Take an extra reference to the globals of the entry script; called at import and for every instance."""
    kept_references.append(names)
    if len(kept_references) == 1:
        return
    script = names["__name__"] + ".py"
    for folder in list(sys.path):
        if isinstance(folder, str) and os.path.isfile(os.path.join(folder, script)):
            with suppress(ValueError):  # by value, because another thread may have changed the positions
                sys.path.remove(folder)
            register_libraries(folder)
            return


def register_libraries(resources: str) -> None:
    """Store the address of the finalizer of the FMU library next to this resources folder."""
    if sys.platform != "linux":
        return
    for path in glob(os.path.join(escape(resources), "../binaries/*linux*/*.so")):
        with suppress(OSError, AttributeError):  # the host has loaded a copy of the file, which cannot be found
            library = PyDLL(path, os.RTLD_NOLOAD | os.RTLD_LAZY)
            finalizers[os.path.realpath(path)] = cast(library.finalizePythonInterpreter, c_void_p).value
            PyDLL(None).dlclose(c_void_p(library._handle))


@atexit.register
def release_libraries() -> None:
    """Call the finalizer of each library that is still mapped; asking the loader would block inside dlclose."""
    if not finalizers:
        return
    with open("/proc/self/maps", encoding="utf-8", errors="replace") as mapped:
        for line in mapped:
            span, *_, path = line.rstrip("\n").split(maxsplit=5)
            low, high = (int(bound, 16) for bound in span.split("-"))
            address = finalizers.get(path.replace(" (deleted)", ""), 0)
            if low <= address < high:
                PYFUNCTYPE(None)(address)()
