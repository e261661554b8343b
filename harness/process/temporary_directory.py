"""Temporary folders, where every library can read their path."""

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


def has_plain_uri(folder: Path) -> bool:
    """Whether the URI of a folder needs no escape but that of the blank."""
    return "%" not in folder.absolute().as_uri().replace("%20", "")


def temporary_root() -> Path:
    """The folder of temporary files: the usual one, or, if that is not plain, another one that is, if there is one."""
    try:
        usual = Path(gettempdir())
    except OSError:
        raise HarnessError("there is no temporary folder that can be written; name one, as in TMPDIR=/tmp") from None
    if has_plain_uri(usual):
        return usual
    return next((Path(place) for place in FALLBACK_DIRECTORIES if os.access(place, os.W_OK | os.X_OK)), usual)


@contextmanager
def temporary_directory(prefix: str = "fmu-") -> Iterator[Path]:
    """A temporary folder, gone afterwards."""
    held = None
    try:
        try:
            with defer_signals():
                held = TemporaryDirectory(prefix=prefix, dir=temporary_root())
        except OSError as error:
            raise HarnessError(f"cannot write into the temporary folder {temporary_root()}: {error.strerror}") from None
        yield Path(held.name)
    finally:
        if held:
            with defer_signals():
                held.cleanup()
