"""What the README's first command installs: every command that needs no extra works, the others name their extra."""

import shutil
import sys

import pytest
from build_cache import ROOT
from environments import PROJECT, build_wheel, call, install, make_environment

from harness.commands import commands

pytestmark = pytest.mark.slow

WORK = {  # by command; all run in one folder, in this order
    "build": ["build", "build --more"],
    "list": ["list"],
    "run": ["", "run stickslip", "run --fmu fmus/more/belt.fmu"],
    "decay": ["decay docs/records/spring.csv --m 0.35", "decay coulomb"],
    "compare": ["compare smd coulomb"],
    "fit": ["fit coulomb docs/records/spring.csv --free f=0.01:0.05 --fixed m=0.35,k=17,x0=0.1 --observe x"],
    "precision": ["precision smd --quick"],
    "stability": ["stability smd"],
    "references": ["references belt.py"],
    "report": ["report"],
}
EXTRAS = {"sweep smd --vary c=1,2": "sweep", "couple two-masses": "coupled", "build --native smd": "native"}

PIP = (sys.executable, "-m", "pip", "--python")


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
    """The folder of a user with the records of the pages and a model file."""
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    shutil.copy(ROOT / "fmus" / "more" / "belt.py", tmp_path)
    return tmp_path


def test_every_command_runs_without_extras(without_extras, user):
    others = {words.split()[0] for words in EXTRAS}
    assert set(WORK) | others == set(commands.commands)
    for words in (line for lines in WORK.values() for line in lines):
        output = call(without_extras, "-m", "harness", *words.split(), cwd=user)
        assert "mpmath" not in output


@pytest.mark.parametrize(("words", "extra"), EXTRAS.items())
def test_a_command_that_needs_an_extra_names_it(without_extras, user, words, extra):
    call(without_extras, "-m", "harness", "build", "smd", cwd=user)
    output = call(without_extras, "-m", "harness", *words.split(), cwd=user, status=1)
    assert f"python -m pip install 'friction-fmus[{extra}]'" in output


@pytest.mark.parametrize("extra", sorted(set(EXTRAS.values()) | {"records", "peers", "importers"}))
def test_the_named_command_installs_an_extra_of_an_installed_project(wheel, tmp_path, extra):
    """pip finds the extra in the installed project, without an index, and the packages of the extra."""
    environment = tmp_path / "environment"
    make_environment(environment, extra)
    install([wheel], environment)
    output = call(
        *PIP, environment / "bin" / "python", "install", "--no-index", f"{PROJECT['name']}[{extra}]", cwd=tmp_path
    )
    assert "Requirement already satisfied: friction-fmus[" in output
