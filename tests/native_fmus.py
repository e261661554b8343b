"""The native FMUs, built once."""

import tempfile
from functools import cache
from pathlib import Path

import pytest
from conftest import ROOT, build


@cache
def room():
    """A folder that lasts as long as the tests."""
    return tempfile.TemporaryDirectory()


@cache
def built(platform="linux64"):
    """The folder of the native FMUs for a platform."""
    pytest.importorskip("ziglang", reason="native FMUs are compiled by the package ziglang: pip install -e '.[native]'")
    return build(ROOT, Path(room().name) / platform, "--native", "--platform", platform, timeout=600)
