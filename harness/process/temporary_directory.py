"""Temporary directories with paths that every library can read, and locks of folders that are in use.

A lock ends with the process that holds it, so a temporary folder without a lock belongs to a killed process. Before a
process creates its first temporary directory, it removes those of killed processes. Locks exist on POSIX (fcntl), but
not on all file systems.
"""

import logging
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import gettempdir, mkdtemp

from ..errors import HarnessError
from .interrupt import defer_signals

if sys.platform != "win32":
    import fcntl

LOG = logging.getLogger(__name__)
PREFIX = "friction-fmus-"  # of the directories of this project
FALLBACK_DIRECTORIES = (
    ("/tmp", "/var/tmp", "/dev/shm") if os.name == "posix" else ("C:/Users/Public", "C:/Windows/Temp")
)


def has_plain_uri(directory: Path) -> bool:
    """Return whether the URI of a directory needs no escape except that of a space."""
    return "%" not in directory.absolute().as_uri().replace("%20", "")


def temporary_root() -> Path:
    """Return the system's temporary directory, or a fallback if its path is not plain."""
    try:
        directory = Path(gettempdir())
    except OSError:
        raise HarnessError("no temporary directory is writable; set one, as in TMPDIR=/tmp") from None
    if has_plain_uri(directory):
        return directory
    return next((Path(path) for path in FALLBACK_DIRECTORIES if os.access(path, os.W_OK | os.X_OK)), directory)


@contextmanager
def temporary_directory(prefix: str = "fmu-") -> Iterator[Path]:
    """Create a temporary directory and remove it on exit."""
    directory, lock = None, ExitStack()
    try:
        try:
            with defer_signals():
                root = temporary_root()
                remove_abandoned_directories(root)
                directory = create_locked_folder(lambda: Path(mkdtemp(prefix=PREFIX + prefix, dir=root)), lock)
        except OSError as error:
            raise HarnessError(
                f"cannot write to the temporary directory {temporary_root()}: {error.strerror}"
            ) from None
        LOG.debug("temporary directory %s is in use", directory)
        yield directory
    finally:
        with defer_signals():
            if directory:
                rmtree(directory, ignore_errors=True)
            lock.close()


@cache
def remove_abandoned_directories(root: Path) -> None:
    """Remove the temporary directories of this user's processes that were killed, once per process."""
    if sys.platform == "win32":  # without locks, they cannot be distinguished from those of running processes
        return
    with suppress(OSError), os.scandir(root) as entries:
        for entry in entries:
            with suppress(OSError):
                if (
                    entry.name.startswith(PREFIX)
                    and entry.is_dir(follow_symlinks=False)
                    and entry.stat(follow_symlinks=False).st_uid == os.getuid()
                ):
                    with lock_path(Path(entry)):  # raises OSError if its process lives
                        rmtree(entry, ignore_errors=True)


def create_locked_folder(create: Callable[[], Path], resources: ExitStack) -> Path:
    """Create a folder and lock it; `resources` holds the lock.

    Between both steps another process may remove the folder, because it has no lock yet; then another one is created.
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
    """Lock a folder or a file, where locks exist; raise OSError if another process holds it and `wait` is false."""
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
