"""Fixture: the environment in which the blocks of pages run."""

import os
import sys
from pathlib import Path

import pytest
from commands import ROOT

from tests.docs.command_server import start_programs


@pytest.fixture(scope="session")
def environment(tmp_path_factory):
    """The environment of processes that find run_blocks and friction-fmus, both of which start at once."""
    folder = tmp_path_factory.mktemp("programs")
    path = os.pathsep.join([str(folder), str(Path(sys.executable).parent), os.environ["PATH"]])
    with start_programs(folder):
        yield {**os.environ, "PYTHONPATH": str(ROOT), "PATH": path, "PROGRAMS": str(folder)}
