"""Build each set of FMUs once per test run. All test processes share one folder; the first one that needs a set
builds it."""

import json
import subprocess
import sys
from fcntl import LOCK_EX, flock
from hashlib import sha256
from pathlib import Path
from tempfile import mkdtemp

import commands
from commands import ROOT, SUPPORT  # noqa: F401 - imported from here by the tests

shared_folder = Path()  # set by conftest.py


def build(root, out, *words, timeout=600):
    """Run the build command on the sources under `root` in a child process and return its standard output."""
    command = [sys.executable, "build_fmus.py", *words, "--out", str(out)]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, done.stderr
    return done.stdout


def build_once(name, *words, timeout=600):
    """Return the folder with the FMUs built with these arguments; the output of the build is in `name`.txt beside
    it."""

    def make(folder):
        (shared_folder / f"{name}.txt").write_text(build(ROOT, folder, *words, timeout=timeout))

    return cached_folder(name, make)


def build_user_model(path, *words):
    """Copy a model file to a folder outside the project, build it there, and return the folder."""

    def make(folder):
        (folder / path.name).write_text(path.read_text())
        done = commands.build(path.name, *words, folder=folder)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith(f"{path.stem}.fmu ")

    digest = sha256(path.read_bytes()).hexdigest()[:12]  # tests may have different models of one name
    return cached_folder("-".join((path.stem, digest, *words)), make)


def run_published_cases():
    """Return the folder of a user who ran the published cases; process.json holds the exit status, stdout and
    stderr."""

    def make(folder):
        (folder / "fmus").symlink_to(build_once("fmi2"))
        done = commands.run_process(folder, COLUMNS="80")
        (folder / "process.json").write_text(json.dumps([done.returncode, done.stdout, done.stderr]))

    return cached_folder("published", make)


def cached_folder(name, make):
    """Return the folder `name`; the first process that asks for it calls `make` to fill it."""
    folder = shared_folder / name
    with (shared_folder / f"{name}.lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not folder.exists():
            make(fresh := Path(mkdtemp(dir=shared_folder)))
            fresh.rename(folder)
    return folder
