"""Options that were renamed: the former names work, help shows the new ones."""

from functools import partial

import commands
import external_fmus
import pytest

import harness
from harness.commands import commands as program

RENAMED = [  # a command with its arguments, an option and its former spellings
    *((command, "--timeout=2.5", "--patience=2.5") for command in ("run", "compare a b", "sweep m --vary c=1,2")),
    *((command, "--rtol=1e-3", "--tolerance=1e-3") for command in ("run", "compare a b", "sweep m --vary c=1,2")),
    ("sweep m --vary c=1,2", "--samples=7", "--random=7"),
    ("sweep m --vary c=1,2", "--measures=final", "--measure=final"),
    ("fit m a.csv", "--set=k=3", "--fixed=k=3"),
    *((command, "--begin=2", "--from=2") for command in ("fit m a.csv", "decay a.csv", "curve a.csv")),
    *((command, "--end=2", "--until=2") for command in ("fit m a.csv", "decay a.csv", "curve a.csv")),
    *((command, "--headings=t,x", "--columns=t,x") for command in ("fit m a.csv", "decay a.csv")),
    ("decay a.csv", "--column=laser", "--position=laser"),
]


def parse(command, option):
    """Return the parameters of a command line, and its help."""
    name, *arguments = command.split()
    with program.commands[name].make_context(name, [*arguments, option]) as context:
        return dict(context.params), program.commands[name].get_help(context)


@pytest.mark.parametrize(("command", "present", "former"), RENAMED)
def test_a_former_name_has_the_same_effect_and_is_not_in_the_help(command, present, former):
    (parameters, text), (former_parameters, _) = parse(command, present), parse(command, former)
    assert parameters == former_parameters
    assert present.split("=")[0] in text
    assert f"{former.split('=')[0]} " not in text


def test_former_options_with_another_form_still_work(tmp_path):
    """--exchange is --interface ModelExchange, and --velocity names a column and its quantity."""
    run = partial(commands.harness, tmp_path, "--json", "--overwrite")
    former, present = (
        run("run", external_fmus.build_external_fmus() / "ModelExchangeOnly.fmu", *words)
        for words in (["--exchange"], ["--interface", "modelexchange"])
    )
    assert (former.returncode, former.stdout) == (0, present.stdout)
    rows = "".join(f"{0.01 * i},{(1 - 0.004 * i) * (-1) ** (i // 25)}\n" for i in range(200))
    (tmp_path / "record.csv").write_text("t [s],speed [m/s]\n" + rows)
    answers = [run("decay", "record.csv", *words) for words in (["--velocity", "speed"], ["--column", "speed"])]
    assert answers[0].stdout == answers[1].stdout
    assert answers[0].stderr == answers[1].stderr
    for name in ("--exchange", "--velocity"):
        assert name not in run("run", "--help").stdout + run("decay", "--help").stdout


@pytest.mark.parametrize("words", [["--rtol", "1e-4"], ["--set", "solver.rtol=1e-4"]])
def test_rtol_sets_the_solver_of_an_fmu_of_this_project(fmus, tmp_path, words):
    (tmp_path / "fmus").symlink_to(fmus)
    done = commands.harness(tmp_path, "run", "fmus/coulomb.fmu", "--set", "solver.method=ode45", *words)
    assert (done.returncode, done.stderr) == (0, "")
    assert harness.load_result(tmp_path / "results/coulomb").parameters["solver.rtol"] == 1e-4


def test_the_values_of_a_fit_are_given_by_one_of_their_names():
    with pytest.raises(harness.SceneError, match="values and fixed: give only values"):
        harness.fit("smd", "a.csv", "k", observe="x", values={"m": 1.0}, fixed={"m": 1.0})
