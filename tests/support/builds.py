"""What is built for the tests is built once a run: its processes share a room, and the first that asks builds."""

import json
import subprocess
import sys
from fcntl import LOCK_EX, flock
from pathlib import Path
from tempfile import mkdtemp

import commands
from commands import ROOT, SUPPORT  # noqa: F401 - both are told here as well

room = Path()  # conftest.py tells where


def build(root, out, *words, timeout=600):
    """Build FMUs from the sources under `root` in a process of their own; what it printed."""
    command = [sys.executable, "build_fmus.py", *words, "--out", str(out)]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, done.stderr
    return done.stdout


def once(name, *words, timeout=600):
    """The folder `name` of the room, with the FMUs that the build command makes of these words; beside it, in a file
    `name`.txt, what it printed."""

    def make(folder):
        (room / f"{name}.txt").write_text(build(ROOT, folder, *words, timeout=timeout))

    return made(name, make)


def of_file(path, *words):
    """The folder of a user's file, outside the project, with what the build command makes beside it of these words."""

    def make(folder):
        (folder / path.name).write_text(path.read_text())
        done = commands.build(path.name, *words, folder=folder)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith(f"{path.stem}.fmu ")

    return made("-".join((path.stem, *words)), make)


def published():
    """The folder of a user who has run the published cases; in said.json the status, and what the command said."""

    def make(folder):
        (folder / "fmus").symlink_to(once("fmi2"))
        done = commands.harness(folder, fresh=True, COLUMNS="80")
        (folder / "said.json").write_text(json.dumps([done.returncode, done.stdout, done.stderr]))

    return made("published", make)


def made(name, make):
    """The folder `name` of the room, which whoever asks first makes."""
    folder = room / name
    with (room / f"{name}.lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not folder.exists():
            make(fresh := Path(mkdtemp(dir=room)))
            fresh.rename(folder)
    return folder
