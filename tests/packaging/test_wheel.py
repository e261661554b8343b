"""The wheel, installed in an environment of its own and used in an empty folder: it has all it needs, and stays."""

import os
import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path
from zipfile import ZipFile

import numpy
import pytest
from models import ROOT

LIBRARIES = Path(numpy.__file__).parents[1]  # the dependencies, which are not installed a second time


def call(*command, cwd, **environment):
    """What a command prints; it must end well."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | environment
    done = subprocess.run([*map(str, command)], cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built from a copy, for setuptools leaves things behind; no network is asked."""
    source = tmp_path_factory.mktemp("source")
    for part in ("fmus", "harness"):
        shutil.copytree(ROOT / part, source / part, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("build_fmus.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / file, source)
    pip = (sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "--no-index", ".")
    call(*pip, "-w", source / "out", cwd=source)
    (file,) = (source / "out").iterdir()
    return file


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """A Python that has the wheel, and its site-packages, which nobody may write."""
    folder = tmp_path_factory.mktemp("environment")
    call(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder)
    python = next(folder.glob("bin/python"))
    call(sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", "--no-index", wheel, cwd=folder)
    (place,) = folder.glob("lib/python*/site-packages")
    (place / "libraries.pth").write_text(f"{LIBRARIES}\n")
    folders = [path for path in (place, *place.rglob("*")) if path.is_dir()]
    for path in folders:
        path.chmod(0o555)
    yield python, place
    for path in folders:
        path.chmod(0o755)


@pytest.fixture
def run(installed, tmp_path):
    """run(words): what `python -m words` prints in an empty folder, which must leave the installation as it was."""
    python, place = installed
    before = content(place)
    yield lambda words: call(python, "-m", *words.split(), cwd=tmp_path)
    assert content(place) == before  # root may write what is read-only


def content(place):
    """The digest of every file."""
    return {path: sha256(path.read_bytes()).digest() for path in place.rglob("*") if path.is_file()}


def test_the_wheel_holds_the_sources_and_their_data_and_no_fmu(wheel):
    with ZipFile(wheel) as archive:
        found = {path for path in archive.namelist() if ".dist-info/" not in path}
    folders = [path for part in ("fmus", "harness") for path in (ROOT / part).rglob("*") if path.is_file()]
    kept = [path.relative_to(ROOT).as_posix() for path in folders if path.suffix not in (".pyc", ".fmu")]
    assert found == {"build_fmus.py", *kept}


def test_the_licence_travels_in_the_wheel(wheel):
    with ZipFile(wheel) as archive:
        (carried,) = [path for path in archive.namelist() if Path(path).name == "LICENSE"]
        assert archive.read(carried) == (ROOT / "LICENSE").read_bytes()


def test_it_builds_and_runs_in_an_empty_folder(run, fmus, tmp_path):
    printed = run("build_fmus stickslip")
    assert printed.startswith("stickslip.fmu ")
    assert {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.fmu")} == {"fmus/stickslip.fmu"}
    assert (tmp_path / "fmus/stickslip.fmu").read_bytes() == (fmus / "stickslip.fmu").read_bytes()
    assert "stickslip" in run("harness run stickslip")
    assert {path.name for path in tmp_path.iterdir()} == {"fmus", "results"}
    assert (tmp_path / "results" / "stickslip" / "trajectory.csv").is_file()


def test_it_freezes_to_c(run, tmp_path):
    pytest.importorskip("ziglang", reason="native FMUs are compiled by the package ziglang: pip install -e '.[native]'")
    run("build_fmus --native smd --method ode23 --platform linux64")
    assert (tmp_path / "fmus" / "native" / "smd.fmu").is_file()
