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
    """The folder with the native FMU of smd for every platform, which offers one method: its libraries differ in what
    a platform asks, not in the numerics."""
    needed()
    chosen = ("smd", "--native", "--method", "exact")
    return builds.once("everywhere", *chosen, *(word for each in PLATFORMS for word in ("--platform", each)))
