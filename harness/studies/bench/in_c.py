"""FMUs in a host in C (host.c), and an FMU that integrates with SUNDIALS CVODE (cvode.c); the system's compiler makes
both on the spot."""

import atexit
import os
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ...errors import HarnessError
from ...process.child import ask
from ...process.room import room
from ...running.compiler import COMPILER, EMBEDDED, HEADERS
from ...running.unpacked import in_python, unpacked

HERE = Path(__file__).parent
HELD = ExitStack()  # folders that last as long as the process
atexit.register(HELD.close)


class NotHereError(HarnessError):
    """What this machine lacks."""


@dataclass(frozen=True)
class Library:
    """The library of an FMU, its value references by name, and what the host passes and loads with it."""

    file: Path
    references: dict[str, int]
    guid: str = ""
    resources: str = ""
    loaded: dict[str, str] = field(default_factory=dict)  # environment


@dataclass(frozen=True)
class Timing:
    """Run time in s of the fastest, and what was read at every point of the last (points, read)."""

    seconds: float
    rows: np.ndarray


def runs(
    library: Library, values: dict[str, float], read: tuple[str, ...], stop: float, steps: int, repeat: int
) -> Timing:
    """Runs from 0 to the stop in equal steps, one after the other on one instance."""
    words = [f"{library.references[name]}={value!r}" for name, value in values.items()]
    words += [str(library.references[name]) for name in read]
    numbers = [str(repeat), repr(stop), str(steps)]
    command = [str(host()), str(library.file), library.guid, library.resources, *numbers, *words]
    done = ask(command, environment={**os.environ, **library.loaded})
    if done.returncode:
        raise HarnessError((done.stderr.splitlines() or [f"{library.file.name} ends the host in C"])[0])
    seconds, *rows = done.stdout.splitlines()
    return Timing(float(seconds), np.array([row.split() for row in rows], dtype=float))


def built(fmu: Path) -> Library:
    """That of a built FMU for Linux; with one in Python its interpreter is loaded too."""
    folder = files(fmu)
    libraries = list((folder / "binaries" / "linux64").glob("*.so"))
    if len(libraries) != 1:
        raise NotHereError(f"not built: {fmu.name} for linux64")
    loaded = {}
    if in_python(folder):
        if not EMBEDDED.is_file():
            raise NotHereError("not installed: Python as a shared library")
        loaded["LD_PRELOAD"] = str(EMBEDDED)
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    references = {each.attrib["name"]: int(each.attrib["valueReference"]) for each in root.iter("ScalarVariable")}
    return Library(libraries[0], references, root.attrib["guid"], (folder / "resources").as_uri(), loaded)


@cache
def cvode(model: str) -> Library:
    """That of the CVODE FMU, compiled for a model."""
    needed = "#include <cvode/cvode.h>\n"
    looking = [compiler(), "-E", "-x", "c", "-", "-o", os.devnull]
    if ask(looking, needed).returncode:
        raise NotHereError("not installed: SUNDIALS for C (on Debian libsundials-dev)")
    options = (f"-DMODEL={model.upper()}", "-shared", "-fPIC")
    file = compiled("cvode.c", f"{model}-cvode.so", options, ("-lsundials_cvode", "-lsundials_nvecserial", "-lm"))
    return Library(file, {name: place for place, name in enumerate(("x", "v", "rtol", "atol", "x_m"))})


@cache
def host() -> Path:
    """The host, as a program."""
    return compiled("host.c", "host", (), ("-ldl",))


def compiled(source: str, name: str, options: tuple[str, ...], libraries: tuple[str, ...]) -> Path:
    """A program or a library from one source."""
    file = programs() / name
    command = [compiler(), "-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", *options, "-I", str(HEADERS)]
    done = ask([*command, str(HERE / source), "-o", str(file), *libraries])
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if "error" in line] or [f"{command[0]} gives no reason"]
        raise NotHereError(f"{source} does not compile here: {lines[0]}")
    return file


def compiler() -> str:
    """The system's compiler."""
    if COMPILER is None:
        raise NotHereError("not installed: a C compiler (try apt-get install gcc)")
    return COMPILER


@cache
def files(fmu: Path) -> Path:
    """The folder of an unpacked FMU."""
    return HELD.enter_context(unpacked(fmu))


@cache
def programs() -> Path:
    """The folder of what was compiled."""
    return HELD.enter_context(room("bench-"))
