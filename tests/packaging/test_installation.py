"""What the README's first command installs: every command that needs no extra works, the others name their extra, and
type checkers find the packages."""

import re
import sys
from math import cos

import pytest
from build_cache import ROOT
from environments import build_wheel, call, install, make_environment
from model_text import BLOCK

from harness.commands import commands

pytestmark = pytest.mark.slow

WORK = {  # by command; all run in one folder, in this order
    "build": ["build smd coulomb stickslip"],
    "info": ["info", "info stickslip"],
    "run": ["run stickslip", "build block.py --method dop853 --method rodas", "run block.fmu"],
    "curve": ["curve bench.csv --mass 2"],
    "decay": ["decay docs/records/spring.csv --mass 0.35", "decay coulomb"],
    "compare": ["compare smd coulomb"],
    "fit": ["fit block.fmu swing.csv --free k=50:200 --set f=0"],
    "precision": ["precision smd --quick"],
    "stability": ["stability block.py"],
    "references": ["references block.py"],
    "report": ["report"],
}
COMMANDS_SCRIPT = """\
import sys
from harness.commands import commands

for line in sys.argv[1:]:
    commands(line.split(), standalone_mode=False)
"""
EXTRAS = {"sweep smd --vary c=1,2": "sweep", "build --native smd": "native"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return build_wheel(tmp_path_factory.mktemp("source"))


@pytest.fixture(scope="module")
def without_extras(wheel, tmp_path_factory):
    """The Python of an environment with the project and what it requires."""
    folder = tmp_path_factory.mktemp("environment")
    make_environment(folder)
    install([wheel], folder)
    return folder / "bin" / "python"


@pytest.fixture
def user(tmp_path):
    """The folder of a user with the records of the pages, points of friction, and a model file with a record."""
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    (tmp_path / "block.py").write_text(BLOCK)
    swing = "".join(f"{0.02 * i},{0.1 * cos(0.2 * i)}\n" for i in range(51))
    (tmp_path / "swing.csv").write_text("t [s],x [m]\n" + swing)
    points = "".join(f"{sign * v},{sign * (1.3 + 2 * v)}\n" for v in (0.01, 0.03, 0.1, 0.2, 0.3) for sign in (1, -1))
    (tmp_path / "bench.csv").write_text("v [m/s],F [N]\n" + points)
    return tmp_path


def test_every_command_runs_without_extras(without_extras, user):
    native = {"map", "orbit", "sensitivity"}  # they need a native FMU, whose build names the extra
    others = {words.split()[0] for words in EXTRAS} | native
    assert set(WORK) | others == set(commands.commands)
    output = call(without_extras, "-c", COMMANDS_SCRIPT, *(line for lines in WORK.values() for line in lines), cwd=user)
    assert "mpmath" not in output


@pytest.mark.parametrize(("words", "extra"), EXTRAS.items())
def test_a_command_that_needs_an_extra_names_it(without_extras, user, words, extra):
    call(without_extras, "-m", "harness", "build", "smd", cwd=user)
    output = call(without_extras, "-m", "harness", *words.split(), cwd=user, status=1)
    assert f"python -m pip install 'friction-fmus[{extra}]'" in output


@pytest.mark.parametrize("form", ["clone", pytest.param("wheel", marks=pytest.mark.campaign)])
def test_the_named_command_adds_an_extra_to_a_clone_and_to_a_wheel(wheel, tmp_path, form):
    """pip finds the extras in the installed project, without an index, and the packages of the extras."""
    extras = sorted(set(EXTRAS.values()) | {"records", "peers", "importers"})
    environment = tmp_path / "environment"
    make_environment(environment, *extras)
    install(["-e", ROOT] if form == "clone" else [wheel], environment)
    pip = (sys.executable, "-m", "pip", "--python", environment / "bin" / "python", "install", "--no-index")
    output = call(*pip, f"friction-fmus[{','.join(extras)}]", cwd=tmp_path)
    requirement = re.search(r"Requirement already satisfied: friction-fmus\[([\w,-]+)\]", output)
    assert sorted(requirement[1].split(",")) == extras
    assert "does not provide the extra" not in output


USER = """\
from typing import assert_type

import fmus
import harness

assert_type(harness.simulate("smd"), harness.RunResult)
assert_type(harness.fit("smd", "record.csv", ["c"], observe=["x"]), harness.FitResult)
assert_type(fmus.Parameter(1.0, "kg", "mass").unit, str)
harness.simulate(stop="late")
"""


@pytest.mark.campaign
def test_mypy_finds_the_types_of_a_clone_from_another_folder(tmp_path):
    environment = tmp_path / "environment"
    make_environment(environment)
    install(["-e", ROOT], environment)
    (tmp_path / "user.py").write_text(USER)
    mypy = (sys.executable, "-m", "mypy", "--python-executable", environment / "bin" / "python", "user.py")
    output = call(*mypy, cwd=tmp_path, status=1)
    errors = [line for line in output.splitlines() if ": error:" in line]
    assert [line.partition("  [")[2].rstrip("]") for line in errors] == ["call-arg", "arg-type"], output
    assert all(line.startswith("user.py:9: ") for line in errors)
