"""Temporary directories with paths that every library can read.

A directory is locked while its process lives. The first directory of a process removes those of killed processes.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import gettempdir, mkdtemp

from ..errors import HarnessError
from .folder_lock import create_locked_folder, lock_path
from .interrupt import defer_signals

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
