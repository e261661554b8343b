"""CONTRIBUTING.md is executed literally in a copy of the project: its files, its changes, its commands."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from build_cache import ROOT

from fmus.compiler.model_lookup import model_names

BLOCK = re.compile(r"^```(\w+) ?(\S*)\n(.*?)^```$", re.M | re.S)
CHANGE = re.compile(r"((?:^-.*\n)+)((?:^\+.*\n)+)", re.M)
PARTS = ("fmus", "harness", "tests", "build_fmus.py", "pyproject.toml", "README.md", "LICENSE")


@pytest.fixture
def project(tmp_path):
    """The copy, with compiled Python files and one of the models; the last command of the page builds all of them."""
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("*.fmu"))
        else:
            shutil.copy(ROOT / part, tmp_path)
    for name in {*model_names()} - {"stickslip"}:
        (tmp_path / "fmus" / f"{name}.py").unlink()
    return tmp_path


def run_line(line, folder):
    """Run a command in the folder; it must succeed."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = os.environ | {"PATH": path, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": ""}
    environment.pop("PYTEST_ADDOPTS", None)  # chooses tests of this run
    result = subprocess.run(line, shell=True, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, f"{line}\n{result.stdout}{result.stderr}"


def apply_change(text, change):
    """Return the text after a change, each part of which must occur once."""
    assert "".join(before + after for before, after in CHANGE.findall(change)) == change
    for before, after in CHANGE.findall(change):
        old, new = (re.sub(r"^[-+]", "", part, flags=re.M).rstrip("\n") for part in (before, after))
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("addition", ["model", "law", "method", "command", "test"])
def test_an_addition_is_a_diff_of_one_file(addition):
    (part,) = (part for part in PAGE.split("\n## ") if part.startswith(f"A {addition}\n"))
    assert len({name for kind, name, _ in BLOCK.findall(part) if kind != "sh"}) == 1


@pytest.mark.slow
def test_each_example_does_what_the_page_says(project):
    files, commands = set(), []
    for kind, name, content in BLOCK.findall(PAGE):
        file = project / name
        if kind == "sh":
            commands += content.splitlines()
            for line in content.splitlines():
                run_line(line, project)
            continue
        assert file.exists() == (kind == "diff"), f"{name} is there already, or not yet"
        file.write_text(apply_change(file.read_text(encoding="utf-8"), content) if kind == "diff" else content)
        files.add(name)
    assert {"build_fmus.py", "harness", "pytest"} <= {word for line in commands for word in line.split()}
    run_line(f"python -m ruff check {' '.join(sorted(files))}", project)
    run_line(f"python -m ruff format --check {' '.join(sorted(files))}", project)
    run_line("lint-imports", project)
