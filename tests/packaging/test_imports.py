"""Imports of the package `fmus` load no more than they need."""

import subprocess
import sys

import pytest

SCRIPT = "import sys; {}; print(*sorted(name for name in sys.modules if name.split('.')[0] in ('fmus', 'numpy')))"
DECLARATIONS = "fmus.packaging.equations.expressions fmus.packaging.equations.model_declaration"
LOADED = {
    "import fmus.runtime.codes": "fmus fmus.runtime fmus.runtime.codes",
    "from fmus import Model, sin, pi": f"fmus fmus.packaging fmus.packaging.equations {DECLARATIONS} fmus.runtime "
    "fmus.runtime.variable_declarations",
}


@pytest.mark.parametrize("statement", LOADED)
def test_an_import_loads_no_other_modules(statement):
    command = [sys.executable, "-c", SCRIPT.format(statement)]
    loaded = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert loaded.split() == LOADED[statement].split()
