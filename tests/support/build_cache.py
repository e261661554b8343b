"""Build each set of FMUs once. All test processes share two folders; the first one that needs a set builds it.

One folder lasts for the test run. The other, in `build/tests`, keeps what is built from the sources alone, so that
later runs find it there until a source or an installed package changes.
"""

import json
import sys
from contextlib import nullcontext
from fcntl import LOCK_EX, LOCK_NB, LOCK_SH, flock
from hashlib import sha256
from importlib.metadata import distributions
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from unittest.mock import patch

import commands
from commands import ROOT, SUPPORT

from fmus.packaging.native import binaries as compiler

shared_folder = Path()  # of this test run; set by conftest.py
kept_folder = Path()  # of all test runs with the same sources; set by conftest.py
UNOPTIMISED_FLAGS = ("-O0", "-fno-sanitize=undefined", *compiler.BIT_EXACT[1:])


def digest_sources():
    """Return a digest of the sources of the builds, the Python and all installed packages."""
    digest = sha256(sys.version.encode())
    for name, version in sorted((item.name, item.version) for item in distributions()):
        digest.update(f"{name} {version}".encode())
    files = [file for folder in (ROOT / "fmus", SUPPORT) for file in folder.rglob("*.*") if file.is_file()]
    programs = (ROOT / "tests/native").glob("*.[ch]")
    for file in sorted({ROOT / "build_fmus.py", *files, *programs}):
        if file.suffix not in (".fmu", ".pyc"):
            digest.update(str(file.relative_to(ROOT)).encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def open_kept_folder(parent):
    """Return the folder in `parent` for builds of the present sources, and its lock; remove those of other sources
    that no test run uses."""
    digest = digest_sources()
    for outdated_folder in (path for path in parent.iterdir() if path.is_dir() and path.name != digest):
        with (parent / f"{outdated_folder.name}.lock").open("w") as lock:
            try:
                flock(lock, LOCK_EX | LOCK_NB)
            except BlockingIOError:
                continue
            rmtree(outdated_folder)
            Path(lock.name).unlink()
    lock = (parent / f"{digest}.lock").open("w")
    flock(lock, LOCK_SH)
    (parent / digest).mkdir(exist_ok=True)
    return parent / digest, lock


def build(*words, folder=ROOT, optimise=False):
    """Run the build command in this process, where models stay lowered, and return its standard output.

    Optimisation changes no digit, but takes four fifths of the time of a compiler, so that native FMUs have none unless
    `optimise` is true.
    """
    with nullcontext() if optimise else patch.object(compiler, "BIT_EXACT", UNOPTIMISED_FLAGS):
        result = commands.build(*words, folder=folder)
    assert (result.returncode, result.stderr) == (0, "")
    return result.stdout


def name_build(kind, *words):
    """Return the name of a build with these arguments; the content of a model file, which is a Path, counts."""
    digests = (f"{w.stem}-{sha256(w.read_bytes()).hexdigest()[:12]}" if isinstance(w, Path) else w for w in words)
    return " ".join((kind, *digests))


def build_once(*words, optimise=False):
    """Return the folder with the FMUs built with these arguments; the output of the build is in a file .txt beside
    it."""
    name = name_build("optimised" if optimise else "unoptimised", *words)

    def make(folder):
        (kept_folder / f"{name}.txt").write_text(build(*map(str, words), "--out", folder, optimise=optimise))

    return keep_build(name, make)


def build_user_model(path, *words, optimise=False):
    """Copy a model file to a folder outside the project, build it there, and return the folder."""

    def make(folder):
        (folder / path.name).write_text(path.read_text())
        output = build(path.name, *words, folder=folder, optimise=optimise)
        assert output.startswith(f"{path.stem}.fmu ")

    return keep_build(name_build("user optimised" if optimise else "user", path, *words), make)


def run_published_cases():
    """Return the folder of a user who ran the published cases; process.json holds the exit status, stdout and
    stderr."""

    def make(folder):
        (folder / "fmus").symlink_to(build_once())
        result = commands.run_process(folder, COLUMNS="80")
        (folder / "process.json").write_text(json.dumps([result.returncode, result.stdout, result.stderr]))

    return cached_folder("published", make)


def keep_build(name, make):
    """Return the folder `name` of all test runs with the same sources; see cached_folder()."""
    return cached_folder(name, make, kept_folder)


def cached_folder(name, make, parent=None):
    """Return the folder `name` of this test run; the first process that asks for it calls `make` to fill it."""
    parent = parent or shared_folder
    folder = parent / name
    with (parent / f"{name}.lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not folder.exists():
            make(fresh := Path(mkdtemp(dir=parent)))
            fresh.rename(folder)
    return folder
