"""Tests go through commands and the API: the modules of the harness that tests import are listed here."""

import ast
from pathlib import Path

from build_cache import ROOT

# Modules with an algorithm, a file format or a process whose claims need no run of an FMU, or cannot be seen in one.
# Remove a module when its last import goes; add none: test a new function through `harness` or a command.
ALLOWED_MODULES = """
.: __main__ commands
analyses.decay: decay_problem decrement intervals signal_model
analyses.fit: fit_problem fit_procedure measured_record profile_likelihood
analyses: slip
process: interrupt interruptible_wait subprocess_runner temporary_directory worker
records: columns extraction record samples size_limits text_table units
references: certified_reference models peer_solvers reference_trajectory
results: folder quantity registry style summary
simulation: embedded_model native_equivalent runner whole_run
simulation.external: step_refinement
scenes: run_spec
studies.precision: study
studies.stability: study
studies.sweep: dispatch result
"""


def allowed_modules():
    modules, package = set(), ""
    for word in ALLOWED_MODULES.split():
        if word.endswith(":"):
            package = "harness" if word == ".:" else f"harness.{word[:-1]}"
        else:
            modules.add(f"{package}.{word}")
    return modules


def is_module(name):
    path = ROOT / name.replace(".", "/")
    return path.is_dir() or path.with_suffix(".py").is_file()


def imported_modules(file):
    """Return the modules of the harness that a file imports; `from package import module` imports the module."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                module = f"{node.module}.{alias.name}"
                yield module if is_module(module) else node.module


def test_tests_import_no_further_module_of_the_harness():
    files = Path(ROOT / "tests").rglob("*.py")
    modules = {module for file in files for module in imported_modules(file) if module.startswith("harness.")}
    assert sorted(modules - allowed_modules()) == []
    assert sorted(allowed_modules() - modules) == []  # remove these from the list
