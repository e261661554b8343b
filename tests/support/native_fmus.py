"""The native FMUs, built once."""

import tempfile
from functools import cache

import build_cache
import pytest

from fmus.packaging.native.compiler import PLATFORMS


@cache
def temporary_folder():
    """A folder that lasts as long as the tests."""
    return tempfile.TemporaryDirectory()


def require_compiler():
    """Skip what needs a compiler, where there is none."""
    pytest.importorskip("ziglang", reason="native FMUs are compiled by the package ziglang: pip install -e '.[native]'")


@cache
def build_native_fmus():
    """The folder of the native FMUs for Linux."""
    require_compiler()
    return build_cache.build_once("linux64", "--native", "--platform", "linux64")


@cache
def build_for_all_platforms():
    """The folder with the native FMU of smd for every platform, which offers one method: its libraries differ in what
    a platform asks, not in the numerics."""
    require_compiler()
    chosen = ("smd", "--native", "--method", "exact")
    return build_cache.build_once("everywhere", *chosen, *(word for each in PLATFORMS for word in ("--platform", each)))
