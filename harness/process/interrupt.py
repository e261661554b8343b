"""Ctrl-C and SIGTERM end a command at once, remove its files and processes and return the usual exit status.

Both signals raise KeyboardInterrupt. C callbacks and FMUs in Python may swallow that exception, so long loops call
`check_interrupt`.
"""

import atexit
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from signal import SIG_IGN, SIGINT, SIGTERM
from threading import current_thread, main_thread
from time import sleep
from traceback import clear_frames
from typing import Any

from ..errors import HarnessError

SIGNALS = (SIGINT, SIGTERM)
RECEIVED_SIGNALS: list[int] = []  # in order of arrival
GRACE_PERIOD = 0.2  # s; Ctrl-C also reaches child processes, whose end may be noticed before the signal


class CommandInterruptedError(HarnessError):
    """A signal ended the command."""

    def __init__(self, message: str = "") -> None:
        number = RECEIVED_SIGNALS[0] if RECEIVED_SIGNALS else SIGINT
        super().__init__(message or ("interrupted" if number == SIGINT else "terminated"))
        self.status = 128 + number


def handle_signal(number: int, frame: Any) -> None:
    """Record a signal and raise KeyboardInterrupt."""
    record_signal(number, frame)
    raise KeyboardInterrupt


def ignore_unraisable_interrupt(unraisable: Any) -> None:
    """Report exceptions that Python cannot raise, as in callbacks. An interrupt is recorded already."""
    if not isinstance(unraisable.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)


def check_interrupt() -> None:
    """Raise KeyboardInterrupt if a signal has been received."""
    if RECEIVED_SIGNALS:
        raise KeyboardInterrupt


def record_signal(number: int, frame: Any) -> None:
    """Record a signal without raising; the handler within `defer_signals`."""
    RECEIVED_SIGNALS.append(number)


@contextmanager
def defer_signals() -> Iterator[None]:
    """Defer signals to the end of the block, for actions that must not stop halfway."""
    handled_signals = current_thread() is main_thread() and [
        number for number in SIGNALS if signal.getsignal(number) == handle_signal
    ]
    before = len(RECEIVED_SIGNALS)
    for number in handled_signals or ():
        signal.signal(number, record_signal)
    try:
        yield
    finally:
        for number in handled_signals or ():
            signal.signal(number, handle_signal)
    if handled_signals and len(RECEIVED_SIGNALS) > before:
        raise KeyboardInterrupt


def exit_after_signal() -> None:
    """Exit at once after a signal.

    Python would otherwise report SIGINT again for an interrupt during an import, and a Python FMU may pass on an
    interrupt late.
    """
    if RECEIVED_SIGNALS:
        os._exit(128 + RECEIVED_SIGNALS[0])  # sys.exit in an exit handler does not set the exit status


@contextmanager
def interruptible() -> Iterator[None]:
    """Handle both signals in the block, unless they are ignored, and raise CommandInterruptedError."""
    for number in SIGNALS:
        if signal.getsignal(number) != SIG_IGN:
            signal.signal(number, handle_signal)
    sys.unraisablehook = ignore_unraisable_interrupt
    atexit.register(exit_after_signal)  # registered first, called last
    try:
        yield
        check_interrupt()
    except BaseException as error:  # a signal can cause any other error
        if isinstance(error, (OSError, EOFError)):
            sleep(GRACE_PERIOD)
        if isinstance(error, KeyboardInterrupt) or (
            RECEIVED_SIGNALS and not isinstance(error, CommandInterruptedError)
        ):
            clear_frames(error.__traceback__)  # closes context managers that were entered but not started
            raise CommandInterruptedError from None
        raise
