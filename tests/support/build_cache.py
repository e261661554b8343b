"""What is built for the tests is built once a run: its processes share a room, and the first that asks builds."""

import json
import subprocess
import sys
from fcntl import LOCK_EX, flock
from pathlib import Path
from tempfile import mkdtemp

import commands
from commands import ROOT, SUPPORT  # noqa: F401 - both are told here as well

shared_folder = Path()  # conftest.py tells where


def build(root, out, *words, timeout=600):
    """Build FMUs from the sources under `root` in a process of their own; what it printed."""
    command = [sys.executable, "build_fmus.py", *words, "--out", str(out)]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, done.stderr
    return done.stdout


def build_once(name, *words, timeout=600):
    """The folder `name` of the room, with the FMUs that the build command makes of these words; beside it, in a file
    `name`.txt, what it printed."""

    def make(folder):
        (shared_folder / f"{name}.txt").write_text(build(ROOT, folder, *words, timeout=timeout))

    return cached_folder(name, make)


def build_user_model(path, *words):
    """The folder of a user's file, outside the project, with what the build command makes beside it of these words."""

    def make(folder):
        (folder / path.name).write_text(path.read_text())
        done = commands.build(path.name, *words, folder=folder)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith(f"{path.stem}.fmu ")

    return cached_folder("-".join((path.stem, *words)), make)


def run_published_cases():
    """The folder of a user who has run the published cases; in process.json the status, and what the command said."""

    def make(folder):
        (folder / "fmus").symlink_to(build_once("fmi2"))
        done = commands.harness(folder, fresh=True, COLUMNS="80")
        (folder / "process.json").write_text(json.dumps([done.returncode, done.stdout, done.stderr]))

    return cached_folder("published", make)


def cached_folder(name, make):
    """The folder `name` of the room, which whoever asks first makes."""
    folder = shared_folder / name
    with (shared_folder / f"{name}.lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not folder.exists():
            make(fresh := Path(mkdtemp(dir=shared_folder)))
            fresh.rename(folder)
    return folder
