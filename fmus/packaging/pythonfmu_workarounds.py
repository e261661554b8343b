"""What keeps the native layer of pythonfmu from freeing twice, and from leaving its mark; travels inside every FMU.

Seen with pythonfmu 0.7.0, the first in reference counts, the second with valgrind:

1. Every instance releases one reference to the names of the entry script, which was only lent.  A script without
   functions of its own loses its names under the second instance.  So each run of the script keeps one more.
2. At the end of the process a library that is still loaded releases its state in a static destructor, then again
   through the pointer left over, which now and then ends in "corrupted double-linked list".
   `finalizePythonInterpreter` clears the pointer; called while Python still runs it makes the later releases find
   nothing.  The library is not held for that: a host that unloads it gets its memory back.
3. Every instance leaves an entry at the head of sys.path.  Nothing needs it once the script has run.
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
    """Called by the entry script, with its names: when it is imported, then whenever an instance is made."""
    kept_references.append(names)
    if len(kept_references) == 1:
        return
    script = names["__name__"] + ".py"
    for folder in list(sys.path):
        if isinstance(folder, str) and os.path.isfile(os.path.join(folder, script)):
            with suppress(ValueError):  # by value: another thread may have moved the places meanwhile
                sys.path.remove(folder)
            register_libraries(folder)
            return


def register_libraries(resources: str) -> None:
    """Note where the library of the FMU in this folder has its last function."""
    if sys.platform != "linux":
        return
    for path in glob(os.path.join(escape(resources), "../binaries/*linux*/*.so")):
        with suppress(OSError, AttributeError):  # a host that loaded a copy of the file: out of reach
            library = PyDLL(path, os.RTLD_NOLOAD | os.RTLD_LAZY)
            finalizers[os.path.realpath(path)] = cast(library.finalizePythonInterpreter, c_void_p).value
            PyDLL(None).dlclose(c_void_p(library._handle))


@atexit.register
def release_libraries() -> None:
    """Call the last function of each library that is still there; asking the loader would block inside dlclose."""
    if not finalizers:
        return
    with open("/proc/self/maps", encoding="utf-8", errors="replace") as mapped:
        for line in mapped:
            span, *_, path = line.rstrip("\n").split(maxsplit=5)
            low, high = (int(bound, 16) for bound in span.split("-"))
            address = finalizers.get(path.replace(" (deleted)", ""), 0)
            if low <= address < high:
                PYFUNCTYPE(None)(address)()
