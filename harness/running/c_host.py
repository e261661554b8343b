"""FMUs in a host in C (host.c), which the system's compiler makes on the spot."""

import os
import shutil
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import fmpy

from ..errors import HarnessError
from ..process.subprocess_runner import run_subprocess
from ..process.temporary_directory import temporary_directory
from .unpacking import PROCESS_RESOURCES, is_python_fmu, unpack

COMPILER = shutil.which("cc") or shutil.which("gcc")
PYTHON_LIBRARY = Path(sysconfig.get_config_var("LIBDIR") or "", sysconfig.get_config_var("INSTSONAME") or "none")
HEADERS = Path(fmpy.__file__).parent / "c-code"


class MissingToolError(HarnessError):
    """What this machine lacks."""


@dataclass(frozen=True)
class Library:
    """The library of an FMU, its value references by name, and what the host passes and loads with it."""

    file: Path
    references: dict[str, int]
    guid: str = ""
    resources: str = ""
    extra_environment: dict[str, str] = field(default_factory=dict)

    @property
    def command(self) -> list[str]:
        """The host with this library."""
        return [str(build_host()), str(self.file), self.guid, self.resources]

    @property
    def environment(self) -> Mapping[str, str]:
        return os.environ | self.extra_environment


@cache
def load_library(fmu: Path) -> Library:
    """That of a built FMU for Linux; with one in Python its interpreter is loaded too."""
    folder = PROCESS_RESOURCES.enter_context(unpack(fmu))
    libraries = list((folder / "binaries" / "linux64").glob("*.so"))
    if len(libraries) != 1:
        raise MissingToolError(f"not built: {fmu.name} for linux64")
    loaded = {}
    if is_python_fmu(folder):
        if not PYTHON_LIBRARY.is_file():
            raise MissingToolError("not installed: Python as a shared library")
        loaded["LD_PRELOAD"] = str(PYTHON_LIBRARY)
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    references = {each.attrib["name"]: int(each.attrib["valueReference"]) for each in root.iter("ScalarVariable")}
    return Library(libraries[0], references, root.attrib["guid"], (folder / "resources").as_uri(), loaded)


@cache
def build_host() -> Path:
    """The host, as a program."""
    return compile_source(Path(__file__).with_name("host.c"), "host", (), ("-ldl", "-lm"))


def compile_source(source: Path, name: str, options: tuple[str, ...], libraries: tuple[str, ...]) -> Path:
    """A program or a library from one source."""
    file = program_directory() / name
    command = [find_compiler(), "-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", *options, "-I", str(HEADERS)]
    done = run_subprocess([*command, str(source), "-o", str(file), *libraries])
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if "error" in line] or [f"{command[0]} gives no reason"]
        raise MissingToolError(f"{source.name} does not compile here: {lines[0]}")
    return file


def find_compiler() -> str:
    """The system's compiler."""
    if COMPILER is None:
        raise MissingToolError("not installed: a C compiler (try apt-get install gcc)")
    return COMPILER


@cache
def program_directory() -> Path:
    """The folder of what was compiled."""
    return PROCESS_RESOURCES.enter_context(temporary_directory("host-"))
