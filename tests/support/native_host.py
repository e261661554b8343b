"""The C programs of tests/support, compiled once per test run, and scripts for the host."""

import os
import shutil
import subprocess
import zipfile
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import fromstring

import build_cache
import fmpy
import pytest
from models import declared, model_class, outputs

from fmus.packaging.native.compiler import STRICT

HEADERS = Path(fmpy.__file__).parent / "c-code"
HOST_SOURCE = Path(__file__).with_name("fmi2_host.c")
FMI3_HOST_SOURCE = HOST_SOURCE.with_name("fmi3_host.c")
SANITIZERS = "address,undefined,float-cast-overflow"
# Report the line of undefined behaviour, which ends in a trap. Keep 32 MB of freed memory under watch; more is slow.
SANITIZER_ENVIRONMENT = os.environ | {"ASAN_OPTIONS": "handle_sigill=1:quarantine_size_mb=32"}


def compiler():
    """Return the C compiler of the system."""
    path = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    return path or pytest.skip("there is no C compiler on this machine: install gcc")


@cache
def compile_cached(name, *words, sanitizers=""):
    """Compile once with these arguments and return the output; sanitized code is not optimised, which would take
    longer."""
    words = [*words, "-ldl", "-lpthread", "-lm"]
    if sanitizers:
        words = [f"-fsanitize={sanitizers}", "-fsanitize-undefined-trap-on-error", "-O0", *words]

    def make(folder):
        command = [compiler(), *STRICT, "-g1", *map(str, words), "-o", str(folder / "made")]
        subprocess.run(command, check=True)

    return build_cache.cached_folder(f"{name} {sanitizers}".strip(), make) / "made"


def host_program(sanitizers="", source=HOST_SOURCE):
    """Return the compiled host program."""
    return compile_cached(source.stem, f"-I{HEADERS}", source, sanitizers=sanitizers)


def compile_sanitized(source, fmu, *how, sanitizers=SANITIZERS):
    """Compile the program `source` of tests/support together with the sources in an FMU, which it includes."""
    name, sources = f"{source} {fmu.stem}", unpack_cached(fmu) / "sources"
    words = ["-c", "-fPIC", "-fvisibility=hidden", f"-I{sources}", HOST_SOURCE.with_name(source)]
    program = compile_cached(name, *words, sanitizers=sanitizers)
    return compile_cached(" ".join([name, "linked", *how]), *how, program, sanitizers=sanitizers)


@cache
def unpack_cached(fmu):
    """Return the folder of an extracted FMU."""

    def make(folder):
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)

    return build_cache.cached_folder(f"{fmu.parent.name} {fmu.stem}", make)


def guid(fmu):
    return fromstring((unpack_cached(fmu) / "modelDescription.xml").read_bytes()).attrib["guid"]


def run_life_cycles(program, fmu, library, number, steps, **options):
    """Run life cycles of an FMI 3.0 FMU in fmi3_host.c, started by `program`.

    Returns the final position and speed in co-simulation and in model exchange, and the lines of standard error.
    """
    name, folder = fmu.stem, unpack_cached(fmu)
    token = fromstring((folder / "modelDescription.xml").read_bytes()).attrib["instantiationToken"]
    read = [value_references(name)[variable] for variable in (*outputs(name)[:2], "m")]
    words = [
        folder / "binaries" / library,
        token,
        f"{folder / 'resources'}{os.sep}",
        number,
        model_class(name).stop_time,
    ]
    command = [*program, *map(str, (*words, steps, *read))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, **options)
    assert done.returncode == 0, done.stderr
    return [
        [float.fromhex(word) for word in line.split()] for line in done.stdout.splitlines()
    ], done.stderr.splitlines()


def run_host_script(fmu, script, threads=1, sanitizers=""):
    """Run a script in the host; return its output lines and standard error. With sanitizers the sources are
    compiled."""
    library = unpack_cached(fmu) / "binaries" / "linux64" / f"{fmu.stem}.so"
    if sanitizers:
        library = compile_sanitized("fmi2_stress.c", fmu, "-shared", sanitizers=sanitizers)
    command = [str(host_program(sanitizers)), str(library), guid(fmu), str(threads)]
    done = subprocess.run(
        command, input="\n".join(script), capture_output=True, text=True, timeout=120, env=SANITIZER_ENVIRONMENT
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout.splitlines(), done.stderr


@cache
def value_references(name):
    """Return the value reference of every variable of a model."""
    return {variable: index for index, variable in enumerate(declared(name))}


def begin(instance, values=(), stop="nan"):
    """Return the script from instantiation to the first step; values are (reference, value)."""
    sets = [f"{instance} setr {reference} {value!r}" for reference, value in values]
    return [f"{instance} new", *sets, f"{instance} setup nan 0 {stop}", f"{instance} enter", f"{instance} exit"]
