"""Result folders, replaced whole or not at all.

A result is written into a folder beside the old one, which then takes its place.  On Linux the two are exchanged in one
step of the file system (renameat2, RENAME_EXCHANGE), on macOS likewise (renamex_np, RENAME_SWAP): whoever looks finds
the old result or the new one at any moment, also after a kill.  Elsewhere, and on a file system that knows no exchange,
it takes two steps, and a kill between them leaves the old result under another name, where the next run finds it.

What a killed run left is removed by the next one into the same place.  What another one still writes is not: its folder
is locked, where there are locks (fcntl).
"""

import ctypes
import os
import re
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from contextvars import ContextVar
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

from ..errors import HarnessError
from ..process.interrupt import defer_signals
from .provenance import FILE, load_provenance, note_replaced_result

if sys.platform != "win32":
    import fcntl

OVERWRITE = ContextVar("overwrite", default=False)  # whether a result of something else may be replaced
FRESH, OLD = ".new", ".old"  # endings of the folders beside, after the name of the result and eight letters
AT_FDCWD, RENAME_EXCHANGE, RENAME_SWAP = -100, 2, 2  # of Linux and macOS


@contextmanager
def replace_folder(folder: Path, ours: Sequence[str], source: str = "") -> Iterator[Path]:
    """A new folder beside `folder` to write into; it takes its place if nothing is raised, and is removed otherwise.
    Its account tells what was there before, by the first of the files that are `ours`.

    Refused with HarnessError if the old folder is a link, holds a file not named in `ours`, which would be lost, or,
    unless that is what the user wants, a result of another `source`.
    """
    try:
        drawn = (name.replace(".svg", ".png") for name in ours)  # as earlier versions drew them
        ours = (*ours, *drawn, FILE)
        check_replaceable(folder, ours)
        check_same_source(folder, source)
        missing = [each for each in folder.absolute().parents if not each.exists()]
        folder.parent.mkdir(parents=True, exist_ok=True)
        clean_up(folder, ours)
    except OSError as error:
        raise HarnessError(f"cannot write below {folder.parent}: {error.strerror}; choose another --out") from None
    fresh, held = None, ExitStack()
    try:
        with defer_signals():
            fresh = create_locked_folder(folder, held)
        yield fresh
        note_replaced_result(folder, fresh, ours[0])
        swap_in(fresh, folder)
    except OSError as error:
        raise HarnessError(f"cannot write {folder}: {error.strerror or error}; choose another --out") from None
    finally:
        with defer_signals():
            if fresh:
                rmtree(fresh, ignore_errors=True)
            held.close()
            with suppress(OSError):  # they are needed
                for each in missing:
                    each.rmdir()


def check_replaceable(folder: Path, ours: Collection[str]) -> None:
    """HarnessError if something is in the way that is no result."""
    if folder.is_symlink():
        raise HarnessError(f"{folder} is a link, which a result does not replace; remove it or choose another --out")
    if folder.exists():
        held = [file.name for file in folder.iterdir()] if folder.is_dir() else ["a file of that name"]
        foreign = sorted(set(held) - set(ours))
        if foreign:
            raise HarnessError(f"{folder} holds {foreign[0]}, which is not a result; move it or choose another --out")


def check_same_source(folder: Path, source: str, account: str = FILE) -> None:
    """HarnessError if a result of another source is there, and the user did not say that it may be replaced."""
    older = load_provenance(folder, account)
    if older.get("source", source) != source and not OVERWRITE.get():
        made = f"`{older['command']}`" + (f", from {older['source']}" if older["source"] else "")
        raise HarnessError(
            f"{folder} holds the result of {made}: keep it and name another --out, or replace it with --overwrite"
        )


def create_locked_folder(folder: Path, held: ExitStack) -> Path:
    """A new folder beside, whose lock is `held`."""
    while True:
        # absolute: an interrupt may come while fmpy, which loads a library, is in its folder
        fresh = Path(mkdtemp(prefix=f".{folder.name}-", suffix=FRESH, dir=folder.parent.absolute()))
        fresh.chmod(0o755)  # mkdtemp gives 0o700
        held.enter_context(lock_folder(fresh, wait=True))
        if fresh.exists():  # nobody took it for one that was left, before it was locked
            return fresh
        held.close()


@contextmanager
def lock_folder(folder: Path, wait: bool = False) -> Iterator[None]:
    """Within, the folder is locked, where there are locks; OSError if another process has it, and one does not wait."""
    if sys.platform == "win32":
        yield
        return
    lock = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError) if wait else nullcontext():  # of a file system without locks
            fcntl.flock(lock, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(lock)


def clean_up(folder: Path, ours: Collection[str]) -> None:
    """Put back what a kill left between the two steps of an exchange, and remove what else killed runs left."""
    beside = re.compile(rf"\.{re.escape(folder.name)}-[a-z0-9_]{{8}}({FRESH}|{OLD})")
    for left in sorted(folder.parent.iterdir()):
        if beside.fullmatch(left.name) and left.is_dir() and {file.name for file in left.iterdir()} <= set(ours):
            with suppress(OSError), lock_folder(left):  # or somebody writes it
                if left.suffix == OLD and not folder.exists():
                    left.rename(folder)
                rmtree(left, ignore_errors=True)


def swap_in(fresh: Path, folder: Path) -> None:
    """Put the fresh folder where the old one is, which is left in its place; the old one stays if that fails."""
    if not folder.exists():
        fresh.rename(folder)
    elif not exchange_folders(fresh, folder):
        old = fresh.with_suffix(OLD)
        with defer_signals():
            folder.rename(old)
            try:
                fresh.rename(folder)
            except OSError:
                old.rename(folder)
                raise
            rmtree(old, ignore_errors=True)


def exchange_folders(one: Path, two: Path) -> bool:
    """Whether two folders have taken each other's place, in one step."""
    ours, theirs = os.fsencode(one), os.fsencode(two)
    try:
        system = ctypes.CDLL(None)
        if sys.platform == "darwin":
            return system.renamex_np(ours, theirs, RENAME_SWAP) == 0
        return system.renameat2(AT_FDCWD, ours, AT_FDCWD, theirs, RENAME_EXCHANGE) == 0
    except (AttributeError, OSError, TypeError):  # another system, or an older one
        return False
