"""Workarounds for the native layer of pythonfmu 0.7.0, in its file PySlaveInstance.cpp; embedded in every Python FMU.

1. handle_py_exception() releases the class, the instance and the log, which the destructor releases again.
   compensate_references() takes the missing references before an exception leaves Python.
2. findClass() releases the globals of the entry script, a reference that it does not own: the second instance frees
   them. Each run of the script calls keep_reference().
3. At process exit a library that is still loaded releases its state in a static destructor, and again through the
   dangling pointer, which sometimes ends in "corrupted double-linked list" (seen with valgrind).
   finalizePythonInterpreter() clears the pointer; release_libraries() calls it while Python still runs, so that the
   later releases do nothing. The library is not kept loaded for this: a host that unloads it gets its memory back.
4. The constructor prepends an entry to sys.path, which is not needed after the script has run.
5. Messages must be valid UTF-8 without NUL.

docs/explanation/architecture.md names the changes of pythonfmu that make this file unnecessary.
"""

from __future__ import annotations

import atexit
import os
import sys
from collections.abc import Iterable
from contextlib import suppress
from ctypes import PYFUNCTYPE, PyDLL, c_ulong, c_void_p, cast, py_object, pythonapi
from functools import partial
from glob import escape, glob
from threading import get_ident
from typing import Any
from weakref import ref

kept_references: list[object] = []
finalizers: dict[str, Any] = {}  # path -> address of its finalizePythonInterpreter


# ---- references


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
    with open("/proc/self/maps", encoding="utf-8", errors="replace") as maps:
        for line in maps:
            span, *_, path = line.rstrip("\n").split(maxsplit=5)
            low, high = (int(bound, 16) for bound in span.split("-"))
            address = finalizers.get(path.replace(" (deleted)", ""), 0)
            if low <= address < high:
                PYFUNCTYPE(None)(address)()


# ---- exceptions


def signal_safe(function: Any) -> Any:
    """Extend the try statement of a function to its first instruction; the body must be one try statement.

    Since Python 3.11 a pending signal is handled on entry to a function, before its first line and hence outside of any
    try.  The exception table (Objects/exception_handling_notes.txt of CPython) begins with start and length of the
    outermost range, in 6 bits a byte.  Earlier versions need no change, if the try statement has at most 127
    instructions.
    """
    table = getattr(function.__code__, "co_exceptiontable", b"")
    if table:
        start, at = _read_varint(table, 0)
        length, at = _read_varint(table, at)
        outermost_range = bytes([0x80]) + _write_varint(start + length)
        function.__code__ = function.__code__.replace(co_exceptiontable=outermost_range + table[at:])
    return function


def _read_varint(table: bytes, at: int) -> tuple[int, int]:
    number = table[at] & 63
    while table[at] & 64:
        at += 1
        number = number << 6 | table[at] & 63
    return number, at + 1


def _write_varint(number: int) -> bytes:
    digits = [number & 63]
    while number > 63:
        number >>= 6
        digits.append(number & 63 | 64)
    return bytes(reversed(digits))


def reraise_later(error: BaseException, message: object) -> object:
    """Raise the exception again in this thread once the message has been released.

    The native layer passes messages to the host, which may run Python, and releases them at the end of the call.  No
    Python code of the FMU may run until then, so the callback consists of C functions only.
    """
    error.__traceback__ = None
    error_class = type(type(error).__name__, (type(error),), {"__new__": lambda cls: error})
    raise_in = pythonapi["PyThreadState_SetAsyncExc"]
    raise_in.argtypes = c_ulong, py_object, py_object  # the last one is the dead weak reference, which C ignores
    return ref(message, partial(raise_in, get_ident(), error_class))


def compensate_references(fmu_class: type, instances: Iterable[Any]) -> None:
    """Take the references that the native layer releases once too often when an exception leaves Python.

    In a class method, the instance whose references it releases is unknown: pass all.
    """
    for instance in instances:
        for released_object in (instance, instance._get_log_queue()):
            pythonapi["Py_IncRef"](py_object(released_object))
    pythonapi["Py_IncRef"](py_object(fmu_class))


def sanitize(text: str) -> str:
    """Return a text without NUL characters that can be encoded in UTF-8."""
    return text.replace("\0", "").encode("utf-8", "backslashreplace").decode()


def write_to_stderr(line: str) -> None:
    """Write a line to standard error, even if the stream is broken.

    The buffer is bypassed: text that cannot be written would stay there, and Python would exit with status 120.
    """
    with suppress(Exception):
        stream = sys.stderr
        encoding = getattr(stream, "encoding", None) or "utf-8"
        content = (line + "\n").encode(encoding, "backslashreplace")
        raw = getattr(getattr(stream, "buffer", None), "raw", None)
        if raw is None:
            stream.write(content.decode(encoding))
            stream.flush()
        else:
            stream.flush()
            raw.write(content)
