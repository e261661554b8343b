"""Result folders, which are replaced completely or not at all.

A result is written to a new folder next to the old one, and the two are then exchanged. On Linux (renameat2,
RENAME_EXCHANGE) and macOS (renamex_np, RENAME_SWAP) the exchange is atomic: any reader, at any moment and after a kill,
finds either the old or the new result. Elsewhere, and on file systems without exchange, it takes two steps. A kill
between them leaves the old result under another name, from which the next run restores it.

A run removes the folders that killed runs left, but not those that another process is writing: these are locked where
locks exist (fcntl).
"""

import ctypes
import logging
import os
import re
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from shutil import rmtree

from ..errors import HarnessError, option_text
from ..process.interrupt import defer_signals
from ..process.temporary_directory import create_locked_folder, lock_path
from .files import DATA_FILE
from .provenance import FILE, load_provenance, note_replaced_result
from .summary import SUMMARY_FILE

LOG = logging.getLogger(__name__)
FRESH, OLD = ".new", ".old"  # suffixes of temporary folders, after the result's name and eight characters
AT_FDCWD, RENAME_EXCHANGE, RENAME_SWAP = -100, 2, 2  # of Linux and macOS


@contextmanager
def replace_folder(folder: Path, own_files: Sequence[str], source: str = "") -> Iterator[Path]:
    """Yield a new folder, which replaces `folder` at the end of the block, or is removed after an exception.

    The provenance of the new result describes how it differs from the old one.

    Parameters
    ----------
    folder : pathlib.Path
        Result folder.
    own_files : sequence of str
        Files that a result may contain, the one to compare first.
    source : str
        Source of the result, as in its provenance.

    Raises
    ------
    HarnessError
        If the old folder is a link, contains other files, or is a result of another `source`.
    """
    try:
        own_files = (*own_files, DATA_FILE, FILE, SUMMARY_FILE)
        check_replaceable(folder, own_files)
        check_same_source(folder, source)
        missing_parents = [parent for parent in folder.absolute().parents if not parent.exists()]
        folder.parent.mkdir(parents=True, exist_ok=True)
        clean_up(folder, own_files)
    except OSError as error:
        raise HarnessError(
            f"cannot write below {folder.parent}: {error.strerror}; choose another {option_text('folder')}"
        ) from None
    new_folder, resources = None, ExitStack()
    try:
        with defer_signals():
            new_folder = create_locked_folder(lambda: create_new_folder(folder), resources)
        LOG.debug("the result %s is being written", folder)
        yield new_folder
        note_replaced_result(folder, new_folder, own_files[0])
        swap_in(new_folder, folder)
    except OSError as error:
        raise HarnessError(
            f"cannot write {folder}: {error.strerror or error}; choose another {option_text('folder')}"
        ) from None
    finally:
        with defer_signals():
            if new_folder:
                rmtree(new_folder, ignore_errors=True)
            resources.close()
            with suppress(OSError):  # not empty
                for parent in missing_parents:
                    parent.rmdir()


def check_replaceable(folder: Path, own_files: Collection[str]) -> None:
    """Raise HarnessError if `folder` is not a result."""
    if folder.is_symlink():
        raise HarnessError(
            f"{folder} is a link and is not replaced; remove it or choose another {option_text('folder')}"
        )
    if folder.exists():
        names = [file.name for file in folder.iterdir()] if folder.is_dir() else ["a file of that name"]
        other_files = sorted(set(names) - set(own_files))
        if other_files:
            raise HarnessError(
                f"{folder} holds {other_files[0]}, which is not part of a result; move it or choose another "
                f"{option_text('folder')}"
            )


def check_same_source(folder: Path, source: str) -> None:
    """Raise HarnessError if a result of another source exists."""
    old = load_provenance(folder)
    if old.get("source", source) != source:
        origin = f"`{old['command']}`" + (f", from {old['source']}" if old.get("source") else "")
        raise HarnessError(
            f"{folder} holds the result of {origin}; choose another {option_text('folder')}, or remove the folder"
        )


def create_new_folder(folder: Path) -> Path:
    """Create a new folder next to the result; the umask determines its permissions."""
    # absolute: fmpy changes the working directory while it loads a library, and a signal may arrive then
    new_folder = folder.parent.absolute() / f".{folder.name}-{token_hex(4)}{FRESH}"
    new_folder.mkdir()
    return new_folder


def clean_up(folder: Path, own_files: Collection[str]) -> None:
    """Restore a result after a kill between the two steps of an exchange, and remove folders of killed runs."""
    pattern = re.compile(rf"\.{re.escape(folder.name)}-[a-z0-9_]{{8}}({FRESH}|{OLD})")
    for leftover in sorted(folder.parent.iterdir()):
        if (
            pattern.fullmatch(leftover.name)
            and leftover.is_dir()
            and {file.name for file in leftover.iterdir()} <= set(own_files)
        ):
            with suppress(OSError), lock_path(leftover):  # another process is writing it
                if leftover.suffix == OLD and not folder.exists():
                    leftover.rename(folder)
                rmtree(leftover, ignore_errors=True)


def swap_in(new_folder: Path, folder: Path) -> None:
    """Replace `folder` by the new folder; keep the old one if that fails."""
    if not folder.exists():
        new_folder.rename(folder)
    elif not exchange_folders(new_folder, folder):
        old = new_folder.with_suffix(OLD)
        with defer_signals():
            folder.rename(old)
            try:
                new_folder.rename(folder)
            except OSError:
                old.rename(folder)
                raise
            rmtree(old, ignore_errors=True)


def exchange_folders(first: Path, second: Path) -> bool:
    """Exchange two folders atomically; return whether that was possible."""
    first_path, second_path = os.fsencode(first), os.fsencode(second)
    try:
        libc = ctypes.CDLL(None)
        if sys.platform == "darwin":
            return libc.renamex_np(first_path, second_path, RENAME_SWAP) == 0
        return libc.renameat2(AT_FDCWD, first_path, AT_FDCWD, second_path, RENAME_EXCHANGE) == 0
    except (AttributeError, OSError, TypeError):  # not supported by the system
        return False
