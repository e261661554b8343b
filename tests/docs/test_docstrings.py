"""Docstrings against the signatures that they describe."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEADING = "Parameters\n----------\n"
ENTRY = re.compile(r"^(\*{0,2}\w[\w, *]*?)(?: : .*)?$")


def described_parameters(docstring):
    """Return the names in the section Parameters of a docstring in the numpydoc format."""
    section = re.split(r"\n.+\n---", docstring.partition(HEADING)[2])[0]
    entries = filter(None, map(ENTRY.match, section.splitlines()))
    return [name.strip(" *") for entry in entries for name in entry[1].split(",")]


def signature_names(node):
    """Return the names of the arguments of a function or class; None for a class that inherits them."""
    if isinstance(node, ast.ClassDef):
        initializers = [part for part in node.body if isinstance(part, ast.FunctionDef) and part.name == "__init__"]
        if not initializers:
            return {part.target.id for part in node.body if isinstance(part, ast.AnnAssign)} or None
        node = initializers[0]
    return {argument.arg for argument in ast.walk(node.args) if isinstance(argument, ast.arg)}


@pytest.mark.parametrize("package", ["fmus", "harness"])
def test_docstrings_describe_parameters_that_exist(package):
    mistakes, n_described = [], 0
    for path in (ROOT / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                names = described_parameters(ast.get_docstring(node) or "")
                parameters = signature_names(node)
                n_described += len(names)
                mistakes += [
                    f"{path}: {node.name} has no {name}" for name in names if parameters and name not in parameters
                ]
    assert n_described > 100
    assert mistakes == []
