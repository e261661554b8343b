"""README.md is short, its code blocks run, its links lead somewhere."""

import re
import subprocess
import sys

import pytest

from tests.docs.test_docs import DOCS, ENVIRONMENT, ROOT

README = ROOT / "README.md"


def test_readme_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 150


@pytest.mark.slow
def test_readme_code_blocks_run(workspace):
    (workspace / "docs").symlink_to(DOCS)
    command = [sys.executable, str(DOCS / "run_blocks.py"), str(workspace), str(README)]
    done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT, timeout=300)
    assert done.returncode == 0, done.stderr


def test_set_up_commands_come_first():
    """.ci/run runs the first two blocks."""
    first, second = re.findall(r"^```sh\n(.*?)^```$", README.read_text(encoding="utf-8"), re.M | re.S)[:2]
    assert "python build_fmus.py && python -m harness" in first
    assert "python -m pytest" in second


def test_links_of_the_readme_exist():
    text = README.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#:]+)\)|src(?:set)?=\"([^\"]+)\"", text):
        (path,) = filter(None, link)
        assert (ROOT / path).exists(), path
