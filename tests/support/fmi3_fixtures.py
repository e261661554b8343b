"""The FMI 3.0 FMUs, built once per test run.

A module, or a conftest.py, runs them instead of the Python FMUs by `fmus = fmi3_fixtures.fmus`.
"""

from functools import cache

import build_cache
import pytest
from native_fmus import require_compiler


@cache
def build_fmi3_fmus():
    """Return the folder of the FMI 3.0 FMUs."""
    require_compiler()
    return build_cache.build_once("--fmi", "3", "--platform", "linux64")


REDUCED_FEATURES = {"stickslip": ("ode23", "hybrid"), "coulomb": ("rodas", "sign")}


@cache
def build_reduced_fmu(name):
    """Return the FMI 3.0 FMU of a model with one method and one friction law."""
    require_compiler()

    def make(folder):
        method, law = REDUCED_FEATURES[name]
        options = ("--method", method, "--law", law, "--platform", "linux64")
        build_cache.build("--fmi", "3", name, *options, "--out", folder)

    return build_cache.keep_build(f"lean fmi3 {name}", make) / f"{name}.fmu"


@pytest.fixture(scope="module")
def fmus():
    """The folder of the FMI 3.0 FMUs."""
    return build_fmi3_fmus()
