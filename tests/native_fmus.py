"""The native FMUs, built once."""

import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@cache
def room():
    """A folder that lasts as long as the tests."""
    return tempfile.TemporaryDirectory()


@cache
def built(platform="linux64"):
    """The folder of the native FMUs for a platform."""
    pytest.importorskip("ziglang", reason="native FMUs are compiled by the package ziglang: pip install -e '.[native]'")
    out = Path(room().name) / platform
    command = [sys.executable, "build_fmus.py", "--native", "--platform", platform, "--out", str(out)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return out
