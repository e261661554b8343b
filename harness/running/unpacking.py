"""An FMU's files in a temporary folder whose path its library can read.

The libraries of pythonfmu and pythonfmu3 take the folder of the resources out of a URI in which they decode %20 and
nothing else: any other escape, and a missing folder, ends in a crash or a hang (0.7.0 and 0.3.4).  So temporary files
lie where the URI needs no escape, and an FMU in Python that lacks what its library would look for is refused.
"""

import atexit
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from shutil import disk_usage
from zipfile import ZipFile

import fmpy

from ..errors import HarnessError, first_line
from ..process.temporary_directory import has_plain_uri, temporary_directory
from ..scenes.fmu_files import check_built
from .cached_by_mtime import cached_by_mtime

SCRIPT_NAME_FILE = (
    "slavemodule.txt"  # the file that names an FMU's script; the libraries of both packages hold its name
)
PROCESS_RESOURCES = ExitStack()  # folders that last as long as the process
atexit.register(PROCESS_RESOURCES.close)


@contextmanager
def unpack(fmu: Path) -> Iterator[Path]:
    """The folder of an FMU's files; HarnessError if it cannot be unpacked, or if its library would crash."""
    check_built(fmu)
    with temporary_directory() as folder:
        try:
            with ZipFile(fmu) as archive:
                size = sum(each.file_size for each in archive.infolist())
            if size > disk_usage(folder).free:
                raise OSError(f"its {size:.3g} bytes are more than the temporary folder has room for")
            fmpy.extract(fmu, folder)
        except Exception as error:  # fmpy raises bare Exceptions, and those of zip readers
            raise HarnessError(f"{fmu.name} cannot be unpacked: {first_line(error)}") from None
        if is_python_fmu(folder):
            check_python_fmu(fmu, folder)
        yield folder


@cached_by_mtime
def unpack_once(fmu: Path) -> Path:
    """The same of a file that is there, for as long as the process lasts."""
    return PROCESS_RESOURCES.enter_context(unpack(fmu))


def is_python_fmu(folder: Path) -> bool:
    """Whether an unpacked FMU is run by the library of pythonfmu or pythonfmu3."""
    libraries = folder.glob("binaries/*/*.*")
    return any(SCRIPT_NAME_FILE.encode() in library.read_bytes() for library in libraries if library.is_file())


def check_python_fmu(fmu: Path, folder: Path) -> None:
    """What the library of an FMU in Python relies on without looking."""
    if not has_plain_uri(folder):
        raise HarnessError(
            f"{fmu.name} is an FMU in Python, which cannot be run from {folder}: its library reads plain letters only; "
            "name another temporary folder, as in TMPDIR=/tmp"
        )
    named = folder / "resources" / SCRIPT_NAME_FILE
    script = named.read_text(encoding="utf-8", errors="replace").split("\n")[0] if named.is_file() else ""
    if not script or not (named.parent / f"{script}.py").is_file():
        missing = f"resources/{script}.py" if script else f"resources/{SCRIPT_NAME_FILE}"
        raise HarnessError(f"{fmu.name} lacks {missing}, without which an FMU in Python crashes: build it again")
