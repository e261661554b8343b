"""What may cross from Python into the native layer that called it: text, and no exception unless it is paid for.

After an exception the layer gives back its references to the class, the instance and the log; freed or reset, it gives
them back once more.
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
    """The function, all of which is one try statement, such that this holds from its first instruction on.

    Since Python 3.11 a signal that has come meanwhile is handled when a function is entered: before the first line of
    it, hence outside of any try.  The table of handlers (Objects/exception_handling_notes.txt of CPython) begins with
    the start and the length of what the outermost covers, in 6 bits a byte.  Before, a function that begins with its
    try is safe as it is, if that is no longer than 127 instructions.
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
    """Raise the exception in this thread again as soon as the message is gone.

    The layer hands the messages to the host, who may run Python for it, and drops them when the call has no more to do:
    what it returns to is the host.  Until then nothing of ours may run, so all that listens is made in C.
    """
    error.__traceback__ = None
    again = type(type(error).__name__, (type(error),), {"__new__": lambda cls: error})
    raise_in = pythonapi["PyThreadState_SetAsyncExc"]
    raise_in.argtypes = c_ulong, py_object, py_object  # the last is the reference that died, which C overlooks
    return ref(message, partial(raise_in, get_ident(), again))


def add_references(*things: object) -> None:
    """Take the references that the layer will give back once too often."""
    for thing in things:
        pythonapi["Py_IncRef"](py_object(thing))


def sanitize(text: str) -> str:
    """A text that can be handed over as UTF-8, and ends where it ends in C."""
    return text.replace("\0", "").encode("utf-8", "backslashreplace").decode()


def write_to_stderr(line: str) -> None:
    """On standard error, whatever has become of it.

    Past its buffer, where there is one: what cannot be written would wait there, and Python end with status 120.
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
