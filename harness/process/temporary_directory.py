"""Temporary directories with paths that every library can read."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

from ..errors import HarnessError
from .interrupt import defer_signals

FALLBACK_DIRECTORIES = (
    ("/tmp", "/var/tmp", "/dev/shm") if os.name == "posix" else ("C:/Users/Public", "C:/Windows/Temp")
)


def has_plain_uri(directory: Path) -> bool:
    """Return whether the URI of a directory needs no escape except that of a space."""
    return "%" not in directory.absolute().as_uri().replace("%20", "")


def temporary_root() -> Path:
    """Return the system's temporary directory, or a fallback if its path is not plain."""
    try:
        usual = Path(gettempdir())
    except OSError:
        raise HarnessError("no temporary directory is writable; set one, as in TMPDIR=/tmp") from None
    if has_plain_uri(usual):
        return usual
    return next((Path(path) for path in FALLBACK_DIRECTORIES if os.access(path, os.W_OK | os.X_OK)), usual)


@contextmanager
def temporary_directory(prefix: str = "fmu-") -> Iterator[Path]:
    """Create a temporary directory and remove it on exit."""
    directory = None
    try:
        try:
            with defer_signals():
                directory = TemporaryDirectory(prefix=prefix, dir=temporary_root())
        except OSError as error:
            raise HarnessError(
                f"cannot write to the temporary directory {temporary_root()}: {error.strerror}"
            ) from None
        yield Path(directory.name)
    finally:
        if directory:
            with defer_signals():
                directory.cleanup()
