"""Imports of the compiler load no more than they need."""

import commands
import pytest
from build_cache import ROOT

SCRIPT = "import sys; {}; print(*sorted(name for name in sys.modules if name.split('.')[0] in ('fmus', 'numpy')))"
DECLARATIONS = " ".join(f"fmus.compiler.equations.{name}" for name in ("expressions", "model_declaration"))
LOADED_MODULES = {
    "import fmus.runtime.codes": "fmus fmus.runtime fmus.runtime.codes",
    "from fmus import Model, sin, pi": f"fmus fmus.compiler fmus.compiler.equations {DECLARATIONS} fmus.runtime "
    "fmus.runtime.variable_declarations",
}


@pytest.mark.parametrize("statement", LOADED_MODULES)
def test_an_import_loads_no_other_modules(statement):
    result = commands.run_python(ROOT, "-c", SCRIPT.format(statement))
    assert (result.stdout.split(), result.stderr) == (LOADED_MODULES[statement].split(), "")


@pytest.mark.slow
def test_the_build_command_runs_without_the_harness(tmp_path):
    """The import contracts cover packages only, and build_fmus.py is a file."""
    script = "import sys; sys.modules['harness'] = None; from build_fmus import main; main()"
    result = commands.run_python(ROOT, "-c", script, "smd", "--out", tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert (tmp_path / "smd.fmu").is_file()
