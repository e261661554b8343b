"""Ctrl-C and SIGTERM: both end a command at once, its files and processes gone, with the status that a shell expects.

Both become KeyboardInterrupt, which takes everything down as an error does.  Something may swallow it on the way, as a
function called from C or somebody else's FMU in Python does: what goes on for long asks `check` now and then.
"""

import atexit
import logging
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from signal import SIG_DFL, SIGINT, SIGTERM, default_int_handler
from threading import current_thread, main_thread
from time import sleep
from traceback import clear_frames
from typing import Any

from ..errors import HarnessError

SIGNALS = (SIGINT, SIGTERM)
RECEIVED_SIGNALS: list[int] = []  # signals, in the order in which they came
GRACE_PERIOD = 0.2  # s; Ctrl-C is for child processes too, and that one of them has ended may be known before


class CommandInterruptedError(HarnessError):
    """Ended from outside; what remains to be said of it is one sentence."""

    def __init__(self, sentence: str = "") -> None:
        number = RECEIVED_SIGNALS[0] if RECEIVED_SIGNALS else SIGINT
        super().__init__(sentence or ("interrupted" if number == SIGINT else "terminated"))
        self.status = 128 + number


def handle_signal(number: int, frame: Any) -> None:
    """The handler of both signals."""
    record_signal(number, frame)
    raise KeyboardInterrupt


def ignore_unraisable_interrupt(unraisable: Any) -> None:
    """The hook for exceptions that Python cannot raise where they occur, as in a callback; an interrupt is kept."""
    if not isinstance(unraisable.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)


def check_interrupt() -> None:
    """KeyboardInterrupt if a signal has come."""
    if RECEIVED_SIGNALS:
        raise KeyboardInterrupt


def record_signal(number: int, frame: Any) -> None:
    """The handler of both while something is begun that could not be ended half begun."""
    RECEIVED_SIGNALS.append(number)
    logging.disable()  # what Dask would log of connections that end is no news


@contextmanager
def defer_signals() -> Iterator[None]:
    """Within, a signal waits until the end: for what must not be left half done."""
    listening = current_thread() is main_thread() and [
        each for each in SIGNALS if signal.getsignal(each) == handle_signal
    ]
    before = len(RECEIVED_SIGNALS)
    for number in listening or ():
        signal.signal(number, record_signal)
    try:
        yield
    finally:
        for number in listening or ():
            signal.signal(number, handle_signal)
    if listening and len(RECEIVED_SIGNALS) > before:
        raise KeyboardInterrupt


@contextmanager
def ignore_sigint() -> Iterator[None]:
    """Processes and threads that are started within never hear a Ctrl-C; the signal waits until the end."""
    from multiprocessing import resource_tracker  # later than `finish` is registered, so that it cleans up before

    resource_tracker.ensure_running()  # which multiprocessing would start within, and unblock what is blocked here
    mask = getattr(signal, "pthread_sigmask", lambda how, signals: None)  # none on Windows
    with defer_signals():
        mask(signal.SIG_BLOCK, [SIGINT])  # which is inherited
        try:
            yield
        finally:
            mask(signal.SIG_UNBLOCK, [SIGINT])


def exit_after_signal() -> None:
    """The last of all that is done at the exit: Python would else tell, for any interrupt in the midst of an import,
    that SIGINT killed it, and an FMU in Python that passes an interrupt on may do so late."""
    if RECEIVED_SIGNALS:
        os._exit(128 + RECEIVED_SIGNALS[0])


@contextmanager
def interruptible() -> Iterator[None]:
    """Within, both signals are heard, unless they were to be ignored, and end in Interrupted."""
    for number, usual in zip(SIGNALS, (default_int_handler, SIG_DFL), strict=True):
        if signal.getsignal(number) == usual:
            signal.signal(number, handle_signal)
    sys.unraisablehook = ignore_unraisable_interrupt
    atexit.register(exit_after_signal)  # the first to be registered is the last to be called
    try:
        yield
        check_interrupt()
    except BaseException as error:  # what a signal made fail may say anything
        if isinstance(error, (OSError, EOFError)):
            sleep(GRACE_PERIOD)
        if isinstance(error, KeyboardInterrupt) or (
            RECEIVED_SIGNALS and not isinstance(error, CommandInterruptedError)
        ):
            clear_frames(error.__traceback__)  # which hold a context that was entered and not yet begun: it is left
            raise CommandInterruptedError from None
        raise
