"""Result folders, replaced whole or not at all."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

from .errors import HarnessError


@contextmanager
def replacing(folder: Path, ours: Collection[str]) -> Iterator[Path]:
    """A new folder beside `folder` to write into; it takes its place if nothing is raised, and is removed otherwise.

    Refused with HarnessError if the old folder holds a file not named in `ours`, which would be lost.
    """
    if folder.exists():
        held = [file.name for file in folder.iterdir()] if folder.is_dir() else ["a file of that name"]
        foreign = sorted(set(held) - set(ours))
        if foreign:
            raise HarnessError(f"{folder} holds {foreign[0]}, which is not a result; move it or choose another --out")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
        fresh.chmod(0o755)  # mkdtemp gives 0o700
    except OSError as error:
        raise HarnessError(f"cannot write below {folder.parent}: {error.strerror}") from None
    try:
        yield fresh
        swap(fresh, folder)
    except OSError as error:
        raise HarnessError(f"cannot write {folder}: {error.strerror}") from None
    finally:
        rmtree(fresh, ignore_errors=True)


def swap(fresh: Path, folder: Path) -> None:
    """Put the fresh folder where the old one is; the old one comes back if that fails."""
    if not folder.exists():
        fresh.rename(folder)
        return
    old = fresh.with_name(f"{fresh.name}-old")
    folder.rename(old)
    try:
        fresh.rename(folder)
    except OSError:
        old.rename(folder)
        raise
    rmtree(old)
