"""The native FMUs, built once."""

import tempfile
from functools import cache

import builds
import pytest


@cache
def room():
    """A folder that lasts as long as the tests."""
    return tempfile.TemporaryDirectory()


def needed():
    """Skip what needs a compiler, where there is none."""
    pytest.importorskip("ziglang", reason="native FMUs are compiled by the package ziglang: pip install -e '.[native]'")


@cache
def built(platform="linux64"):
    """The folder of the native FMUs for a platform."""
    needed()
    return builds.once(platform, "--native", "--platform", platform, timeout=600)
