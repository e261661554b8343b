"""Locks of folders and files. A lock ends with the process that holds it: a folder without one was left by a kill.

Locks exist on POSIX (fcntl), but not on all of its file systems.
"""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path

if sys.platform != "win32":
    import fcntl


def create_locked_folder(create: Callable[[], Path], resources: ExitStack) -> Path:
    """Create a folder and lock it; `resources` holds the lock.

    Another process may take a folder without a lock for a leftover and remove it: then another one is created.
    """
    while True:
        folder = create()
        with suppress(FileNotFoundError):
            resources.enter_context(lock_path(folder, wait=True))
        if folder.exists():
            return folder
        resources.close()


@contextmanager
def lock_path(path: Path, wait: bool = False) -> Iterator[None]:
    """Lock a folder or a file, where locks exist; raise OSError if another process has it and `wait` is false."""
    if sys.platform == "win32":
        yield
        return
    lock = os.open(path, os.O_RDONLY)
    try:
        with suppress(OSError) if wait else nullcontext():  # file systems without locks
            fcntl.flock(lock, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(lock)
