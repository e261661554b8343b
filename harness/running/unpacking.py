"""Unpacks FMUs into temporary directories whose path their library can read.

The libraries of pythonfmu 0.7.0 and pythonfmu3 0.3.4 decode only %20 in the URI of the resources; other escapes, and a
missing directory, crash or hang. Temporary files therefore lie where the URI needs no escape, and FMUs in Python that
lack required files are refused.
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
    "slavemodule.txt"  # names the script of an FMU in Python; the libraries of both packages contain its name
)
PROCESS_RESOURCES = ExitStack()  # directories that exist until the process ends
atexit.register(PROCESS_RESOURCES.close)


@contextmanager
def unpack(fmu: Path) -> Iterator[Path]:
    """Unpack an FMU and remove its files on exit.

    Raises
    ------
    HarnessError
        If the FMU cannot be unpacked, or its library would crash.
    """
    check_built(fmu)
    with temporary_directory() as directory:
        try:
            with ZipFile(fmu) as archive:
                size = sum(member.file_size for member in archive.infolist())
            if size > disk_usage(directory).free:
                raise OSError(f"its {size:.3g} bytes do not fit into the temporary directory")
            fmpy.extract(fmu, directory)
        except Exception as error:  # fmpy raises bare Exceptions, and those of zip readers
            raise HarnessError(f"{fmu.name} cannot be unpacked: {first_line(error)}") from None
        if is_python_fmu(directory):
            check_python_fmu(fmu, directory)
        yield directory


@cached_by_mtime
def unpack_once(fmu: Path) -> Path:
    """Unpack an FMU for as long as the process lasts."""
    return PROCESS_RESOURCES.enter_context(unpack(fmu))


def is_python_fmu(directory: Path) -> bool:
    """Return whether an unpacked FMU uses the library of pythonfmu or pythonfmu3."""
    libraries = directory.glob("binaries/*/*.*")
    return any(SCRIPT_NAME_FILE.encode() in library.read_bytes() for library in libraries if library.is_file())


def check_python_fmu(fmu: Path, directory: Path) -> None:
    """Check the files that the library of an FMU in Python requires but does not check itself."""
    if not has_plain_uri(directory):
        raise HarnessError(
            f"{fmu.name} is an FMU in Python, which cannot be run from {directory}: its library reads plain characters "
            "only; set another temporary directory, as in TMPDIR=/tmp"
        )
    name_file = directory / "resources" / SCRIPT_NAME_FILE
    script = name_file.read_text(encoding="utf-8", errors="replace").split("\n")[0] if name_file.is_file() else ""
    if not script or not (name_file.parent / f"{script}.py").is_file():
        missing = f"resources/{script}.py" if script else f"resources/{SCRIPT_NAME_FILE}"
        raise HarnessError(f"{fmu.name} lacks {missing}, without which an FMU in Python crashes: build it again")
