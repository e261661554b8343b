"""What is built for the tests is built once a run: its processes share a room, and the first that asks builds."""

import subprocess
import sys
from fcntl import LOCK_EX, flock
from pathlib import Path
from tempfile import mkdtemp

SUPPORT = Path(__file__).parent
ROOT = SUPPORT.parents[1]
room = Path()  # conftest.py tells where


def build(root, out, *words, timeout=120):
    """Build FMUs from the sources under `root` in a process of their own."""
    command = [sys.executable, "build_fmus.py", *words, "--out", str(out)]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, done.stderr
    return out


def once(name, *words, timeout=120):
    """The folder `name` of the room, with the FMUs that the build command makes of these words."""
    folder = room / name
    with (room / f"{name}.lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not folder.exists():
            build(ROOT, Path(mkdtemp(dir=room)), *words, timeout=timeout).rename(folder)
    return folder
