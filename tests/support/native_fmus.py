"""The native FMUs, built once."""

import tempfile
from functools import cache

import builds
import pytest

from fmus.packaging.native.compiler import PLATFORMS


@cache
def room():
    """A folder that lasts as long as the tests."""
    return tempfile.TemporaryDirectory()


def needed():
    """Skip what needs a compiler, where there is none."""
    pytest.importorskip("ziglang", reason="native FMUs are compiled by the package ziglang: pip install -e '.[native]'")


@cache
def built():
    """The folder of the native FMUs for Linux."""
    needed()
    return builds.once("linux64", "--native", "--platform", "linux64")


@cache
def everywhere():
    """The folder with the native FMU of smd for every platform."""
    needed()
    return builds.once("everywhere", "smd", "--native", *(word for each in PLATFORMS for word in ("--platform", each)))
