"""Runs of FMUs in a C program (host.c), compiled on demand by the system's compiler."""

import os
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import fmpy

from harness.errors import HarnessError
from harness.process.subprocess_runner import run_subprocess
from harness.process.temporary_directory import temporary_directory
from harness.simulation.fmu_archive import PROCESS_RESOURCES, is_python_fmu, unpack
from harness.simulation.whole_run import COMPILER

PYTHON_LIBRARY = Path(sysconfig.get_config_var("LIBDIR") or "", sysconfig.get_config_var("INSTSONAME") or "none")
HEADERS = Path(fmpy.__file__).parent / "c-code"


class MissingToolError(HarnessError):
    """A tool or a build is missing on this machine."""


@dataclass(frozen=True)
class Library:
    """Library of an FMU with its value references by name, and the data with which the host loads it."""

    file: Path
    references: dict[str, int]
    guid: str = ""
    resources: str = ""
    extra_environment: dict[str, str] = field(default_factory=dict)

    @property
    def command(self) -> list[str]:
        """Return the command that runs the host with this library."""
        return [str(build_host()), str(self.file), self.guid, self.resources]

    @property
    def environment(self) -> Mapping[str, str]:
        return os.environ | self.extra_environment


@cache
def load_library(fmu: Path) -> Library:
    """Unpack a built FMU for Linux and return its library; for a Python FMU, preload its interpreter."""
    directory = PROCESS_RESOURCES.enter_context(unpack(fmu))
    libraries = list((directory / "binaries" / "linux64").glob("*.so"))
    if len(libraries) != 1:
        raise MissingToolError(f"not built: {fmu.name} for linux64")
    extra_environment = {}
    if is_python_fmu(directory):
        if not PYTHON_LIBRARY.is_file():
            raise MissingToolError("not installed: Python as a shared library")
        extra_environment["LD_PRELOAD"] = str(PYTHON_LIBRARY)
    root = ElementTree.parse(directory / "modelDescription.xml").getroot()
    references = {
        variable.attrib["name"]: int(variable.attrib["valueReference"]) for variable in root.iter("ScalarVariable")
    }
    return Library(libraries[0], references, root.attrib["guid"], (directory / "resources").as_uri(), extra_environment)


@cache
def build_host() -> Path:
    """Compile the host and return its path."""
    return compile_source(Path(__file__).with_name("host.c"), "host", (), ("-ldl", "-lm"))


def compile_source(source: Path, name: str, options: tuple[str, ...], libraries: tuple[str, ...]) -> Path:
    """Compile a program or a library from one source file and return its path."""
    file = program_directory() / name
    command = [find_compiler(), "-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", *options, "-I", str(HEADERS)]
    process = run_subprocess([*command, str(source), "-o", str(file), *libraries])
    if process.returncode:
        lines = [line for line in process.stderr.splitlines() if "error" in line] or [f"{command[0]} gives no reason"]
        raise MissingToolError(f"{source.name} does not compile here: {lines[0]}")
    return file


def find_compiler() -> str:
    """Return the system's C compiler; raise MissingToolError if there is none."""
    if COMPILER is None:
        raise MissingToolError("not installed: a C compiler (try apt-get install gcc)")
    return COMPILER


@cache
def program_directory() -> Path:
    """Return the directory of compiled programs."""
    return PROCESS_RESOURCES.enter_context(temporary_directory("host-"))
