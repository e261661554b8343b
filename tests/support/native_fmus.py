"""The native FMUs, built once per test run.

A module runs the Python and the native FMUs in turn by `fmus = native_fmus.backend_fmus`.
"""

from functools import cache

import build_cache
import pytest

from fmus.packaging.native.binaries import PLATFORMS


def require_compiler():
    """Skip the test if there is no compiler."""
    pytest.importorskip("ziglang", reason="native FMUs are compiled by the package ziglang: pip install -e '.[native]'")


@cache
def build_native_fmus():
    """Return the folder of the native FMUs for Linux."""
    require_compiler()
    return build_cache.build_once("--native", "--platform", "linux64", optimise=True)


@cache
def build_for_all_platforms():
    """Return the folder with a native FMU of smd for every platform, as users build it but with one method, because
    only the platforms matter here."""
    require_compiler()
    options = ("smd", "--native", "--method", "exact")
    platforms = (word for item in PLATFORMS for word in ("--platform", item))
    return build_cache.build_once(*options, *platforms, optimise=True)


@pytest.fixture(params=["python", "native"])
def backend_fmus(request, fmus):
    """The folder of the FMUs of one backend."""
    return fmus if request.param == "python" else build_native_fmus()
