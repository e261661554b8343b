"""The C host of tests/support, compiled by the system's compiler, and scripts for it."""

import os
import shutil
import subprocess
import zipfile
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import fromstring

import fmpy
import pytest
from models import declared, model_class, outputs
from native_fmus import room

from fmus.packaging.native.compiler import LIBRARY, SAME_BITS, STRICT

HEADERS = Path(fmpy.__file__).parent / "c-code"
SOURCE = Path(__file__).with_name("host.c")
SOURCE3 = SOURCE.with_name("fmi3_host.c")


def compiler():
    """The system's C compiler."""
    found = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    return found or pytest.skip("there is no C compiler on this machine: install gcc")


@cache
def folder(kind):
    """A folder for binaries of one kind."""
    path = Path(room().name) / (kind or "plain")
    path.mkdir()
    return path


@cache
def host(sanitizer="", source=SOURCE):
    """The host, as a program."""
    out = folder(f"{sanitizer} {source.stem}") / "host"
    command = [compiler(), *STRICT, "-g1", *sanitized(sanitizer), f"-I{HEADERS}", str(source), "-o", str(out)]
    subprocess.run([*command, "-ldl", "-lpthread", "-lm"], check=True)
    return out


def sanitized(kind):
    """Options for sanitizers, if any; nobody compares the bits of these, and to optimise takes longer than to run."""
    return [f"-fsanitize={kind}", "-fno-sanitize-recover=all", "-O0"] if kind else []


@cache
def unpacked(fmu):
    """The folder of an extracted FMU."""
    out = folder("unpacked") / fmu.parent.name / fmu.stem
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(out)
    return out


def guid(fmu):
    return fromstring((unpacked(fmu) / "modelDescription.xml").read_bytes()).attrib["guid"]


def lives(program, fmu, library, number, steps, **options):
    """What fmi3_host.c, started by `program`, tells of lives of an FMI 3.0 FMU: the last position and speed in
    co-simulation and in model exchange, and the lines that it says."""
    name, place = fmu.stem, unpacked(fmu)
    token = fromstring((place / "modelDescription.xml").read_bytes()).attrib["instantiationToken"]
    read = [references(name)[variable] for variable in (*outputs(name)[:2], "m")]
    words = [place / "binaries" / library, token, f"{place / 'resources'}{os.sep}", number, model_class(name).stop_time]
    command = [*program, *map(str, (*words, steps, *read))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, **options)
    assert done.returncode == 0, done.stderr
    return [
        [float.fromhex(word) for word in line.split()] for line in done.stdout.splitlines()
    ], done.stderr.splitlines()


@cache
def compiled_here(fmu, sanitizer=""):
    """The library from the sources in the FMU, by the system's compiler."""
    out = folder(sanitizer) / f"{fmu.stem}.so"
    command = [compiler(), *STRICT, *SAME_BITS, *LIBRARY, "-g1", *sanitized(sanitizer), "fmi2.c", "-o", str(out), "-lm"]
    subprocess.run(command, cwd=unpacked(fmu) / "sources", check=True)
    return out


def play(fmu, script, threads=1, sanitizer="", shipped=True):
    """What the script answers, line by line, and what went to standard error."""
    library = unpacked(fmu) / "binaries" / "linux64" / f"{fmu.stem}.so" if shipped else compiled_here(fmu, sanitizer)
    command = [str(host(sanitizer)), str(library), guid(fmu), str(threads)]
    done = subprocess.run(command, input="\n".join(script), capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout.splitlines(), done.stderr


@cache
def references(name):
    """The value reference of every variable of a model."""
    return {variable: place for place, variable in enumerate(declared(name))}


def begin(instance, values=(), stop="nan"):
    """The script from instantiation to the first step; values are (reference, value)."""
    sets = [f"{instance} setr {reference} {value!r}" for reference, value in values]
    return [f"{instance} new", *sets, f"{instance} setup nan 0 {stop}", f"{instance} enter", f"{instance} exit"]
