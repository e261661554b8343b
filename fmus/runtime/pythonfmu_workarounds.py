"""Workarounds for the native layer of pythonfmu: exceptions, references, texts and standard error.

After an exception the layer releases its references to the class, the instance and the log; when the instance is freed
or reset, it releases them again.  Add the missing references before an exception leaves Python.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from ctypes import c_ulong, py_object, pythonapi
from functools import partial
from threading import get_ident
from typing import Any
from weakref import ref


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
        covered = bytes([0x80]) + _write_varint(start + length)
        function.__code__ = function.__code__.replace(co_exceptiontable=covered + table[at:])
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
    again = type(type(error).__name__, (type(error),), {"__new__": lambda cls: error})
    raise_in = pythonapi["PyThreadState_SetAsyncExc"]
    raise_in.argtypes = c_ulong, py_object, py_object  # the last one is the dead weak reference, which C ignores
    return ref(message, partial(raise_in, get_ident(), again))


def add_references(*objects: object) -> None:
    """Add the references that the native layer releases once too often."""
    for one in objects:
        pythonapi["Py_IncRef"](py_object(one))


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
