"""The C programs of the tests, compiled once per test run, and scripts for the host."""

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
from models import ROOT, declarations_of, model_class, outputs

from fmus.packaging.native.binaries import STRICT

HEADERS = Path(fmpy.__file__).parent / "c-code"
HOST_SOURCE = Path(__file__).with_name("host.c")
VERSION_OPTIONS = {"2": [], "3": ["-DFMI3"]}  # of the host, by the version of FMI
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

    return build_cache.keep_build(f"{name} {sanitizers}".strip(), make) / "made"


def host_program(sanitizers="", version="2"):
    """Return the compiled host program for a version of FMI."""
    words = [*VERSION_OPTIONS[version], f"-I{HEADERS}", HOST_SOURCE]
    return compile_cached(f"host {version}", *words, sanitizers=sanitizers)


def compile_sanitized(source, fmu, *options, sanitizers=SANITIZERS):
    """Compile the program `source` of tests/native together with the sources in an FMU, which it includes."""
    name, sources = f"{source} {fmu.stem}", unpack_cached(fmu) / "sources"
    words = ["-c", "-fPIC", "-fvisibility=hidden", f"-I{sources}", ROOT / "tests/native" / source]
    program = compile_cached(name, *words, sanitizers=sanitizers)
    return compile_cached(" ".join([name, "linked", *options]), *options, program, sanitizers=sanitizers)


@cache
def unpack_cached(fmu):
    """Return the folder of an extracted FMU."""

    def make(folder):
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)

    return build_cache.cached_folder(f"{fmu.parent.name} {fmu.stem}", make)


def version_and_guid(fmu):
    """Return the version of FMI, 2 or 3, and the GUID or instantiation token of an FMU."""
    root = fromstring((unpack_cached(fmu) / "modelDescription.xml").read_bytes())
    version = root.attrib["fmiVersion"][0]
    return version, root.attrib["guid" if version == "2" else "instantiationToken"]


def run_host_script(fmu, script, threads=1, sanitizers="", environment=None):
    """Run a script in the host; return its output lines and standard error. With sanitizers the sources are
    compiled."""
    version, _ = version_and_guid(fmu)
    folder = {"2": "linux64", "3": "x86_64-linux"}[version]
    library = unpack_cached(fmu) / "binaries" / folder / f"{fmu.stem}.so"
    if sanitizers:
        library = compile_sanitized("fmi2_stress.c", fmu, "-shared", sanitizers=sanitizers)
    environment = environment or SANITIZER_ENVIRONMENT
    return run_host([host_program(sanitizers, version)], library, fmu, script, threads, environment)


def run_host(program, library, fmu, script, threads=1, environment=None):
    """Run a script in a host, started by the command `program`, on this library of an FMU."""
    version, guid = version_and_guid(fmu)
    folder = unpack_cached(fmu) / "resources"
    resources = folder.as_uri() if version == "2" else f"{folder}{os.sep}"
    command = [str(word) for word in (*program, library, guid, resources, threads)]
    options = {"capture_output": True, "text": True, "timeout": 120, "env": environment}
    result = subprocess.run(command, input="\n".join(script), **options)
    assert result.returncode == 0, result.stderr[-3000:]
    return result.stdout.splitlines(), result.stderr


@cache
def value_references(name):
    """Return the value reference of every variable of a model."""
    return {variable: index for index, variable in enumerate(declarations_of(name))}


def begin(instance, values=(), stop="nan"):
    """Return the script from instantiation to the first step; values are (reference, value)."""
    sets = [f"{instance} setr {reference} {value!r}" for reference, value in values]
    return [f"{instance} new", *sets, f"{instance} setup nan 0 {stop}", f"{instance} enter", f"{instance} exit"]


def life_cycle(name, steps, exchange=False, references=None):
    """Return the script of an instance of an FMI 3.0 FMU, which reads position and speed.

    The second half of a run is repeated from a saved state and from a serialized one; after a reset, the complete run.
    In model exchange, Euler steps integrate.  `references` are those of an FMU that lacks some of the variables.
    """
    references = references or value_references(name)
    states = len(model_class(name).states) + ("x_driver" in declarations_of(name))
    step_command, (x, v, *_) = f"euler {states}" if exchange else "run", outputs(name)
    stop, columns = model_class(name).stop_time, f"{references[x]} {references[v]}"
    first, second = (
        f"{step_command} {a} {b} {steps // 2} {columns}" for a, b in ((0.0, 0.5 * stop), (0.5 * stop, stop))
    )
    start = ["enter", "exit", first]
    script = ["new exchange" if exchange else "new", *start, "save 1", second, "restore 1", second, "serialize 1 2"]
    script += ["deserialize 3 2", "restore 3", second, "drop 1", "drop 3", "reset", *start, second, "terminate", "free"]
    return [f"0 {line}" for line in script]


def read_values(answers):
    """Return the values in the answers that have several; all calls must have succeeded."""
    assert {line.split()[0] for line in answers} == {"0"}, answers
    return [[float.fromhex(word) for word in line.split()[1:]] for line in answers if " " in line]
