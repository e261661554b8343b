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
def built(*platforms):
    """The folder of the native FMUs for Linux, or for these platforms."""
    needed()
    platforms = platforms or ("linux64",)
    words = [word for platform in platforms for word in ("--platform", platform)]
    return builds.once("-".join(platforms), "--native", *words, timeout=600)
