"""Sources, options and values that a command cannot use are refused in one sentence.

The tests of an analysis have what its records and scenes cannot hold.
"""

import commands
import external_fmus
import fmi3_fixtures
import pytest

NO_SUCH = ("nosuch", "nosuch.fmu", "nosuch.py", "nosuch.toml", "nosuch.csv", "nosuch.h5", "results/nosuch")
COMMANDS = (  # with every argument that names a source
    ("run",),
    ("compare", "coulomb"),
    ("decay",),
    ("sweep", "--vary", "k=1,2"),
    ("stability",),
    ("precision",),
    ("references",),
    ("build",),
)


def assert_one_sentence(result, status, sentence):
    assert (result.returncode, result.stdout) == (status, "")
    assert sentence in result.stderr
    assert result.stderr.count("Error: ") == 1
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("name", ["run", "decay", "curve", "compare"])
def test_an_empty_source_is_called_so(workspace, name):
    """Its path would be the current folder."""
    assert_one_sentence(commands.harness(workspace, name, "", *["coulomb"] * (name == "compare")), 2, "is empty")


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_source_that_does_not_exist_is_called_so(workspace, command):
    for source in NO_SUCH:
        result = commands.harness(workspace, *command, source)
        assert_one_sentence(result, result.returncode, "nosuch")
        assert result.returncode
        phrases = ("does not exist", "no file or folder", "there is no", "There is no", "No such file")
        assert any(phrase in result.stderr for phrase in phrases), (source, result.stderr)
    assert not (workspace / "results").exists()


OWN_FMU = "fmus/smd.fmu"
FIT = ["fit", "stickslip", "line.csv", "--observe", "x"]
SWEEP = ["sweep", "smd", "--vary", "m=1:2:3"]

OPTIONS_WITHOUT_EFFECT = [
    (["run", "stickslip", "--interface", "ModelExchange", "--rtol", 0.5], "--rtol"),
    (["run", "stickslip", "--lenient"], "--lenient"),
    (["sweep", "smd", "--vary", "m=1,2", "--timeout", 5], "--timeout"),
    (["compare", "coulomb", "coulomb-sign", "--interface", "ModelExchange"], "--interface"),
    (["compare", OWN_FMU, "fmus/coulomb.fmu", "--rtol", 0.5], "--rtol"),
    (["compare", "line.csv", "line.csv", "--stop", 2], "--stop"),
    (["sweep", "smd", "--vary", "m=1,2", "--rtol", 0.5], "--rtol"),
    (["sweep", "smd", "--vary", "m=1,2", "--seed", 5], "--seed"),
    (["decay", "coulomb", "--unit", "mm"], "--unit"),
    (["decay", "coulomb", "--headings", "t,x"], "--headings"),
    (["decay", "coulomb", "--rate", 100], "--rate"),
]
COMMAND_LINES = [  # arguments, exit status, words of the sentence
    (["runn"], 2, "runn"),
    (["--nosuch"], 2, "--nosuch"),
    (["run"], 2, "Missing argument 'MODEL|SCENE|FMU'"),
    (["run", "nosuch"], 2, "unknown model or scene 'nosuch'"),
    *((arguments, 2, f"{option} has no effect ") for arguments, option in OPTIONS_WITHOUT_EFFECT),
    (["compare", "fmus", OWN_FMU], 2, "trajectory.csv is missing"),
    (["decay", "stickslip"], 1, "fit stickslip for a driven motion"),
    (["decay", "line.csv", "--k", 1, "--mass", 1], 2, "--k and --mass"),
    ([*FIT, "--free", "k=3"], 2, "--free k=3: give a range, as in k=0.1:2, or fix it by --set k=3"),
    ([*FIT, "--free", "k=3:x"], 2, "--free k=3:x: 'x' is not a finite number"),
    ([*FIT, "--free", "k,k"], 2, "--free names k twice: remove one"),
    ([*FIT, "--free", "k", "--set", "m"], 2, "--set 'm' is not an assignment: write it as in k=100,m=3"),
    ([*FIT, "--free", "k", "--set", "m=1", "--set", "m=2"], 2, "--set names m twice: give it one value"),
    ([*FIT, "--free", "k", "--sigma", "x=1,x=2"], 2, "--sigma names x twice: give it one value"),
    (["run", OWN_FMU, "--set", "m=1", "--set", "m=2"], 2, "--set names m twice: give it one value"),
    ([*SWEEP, "--set", "k=1", "--set", " k=1"], 2, "--set names k twice: give it one value"),
    ([*FIT, "--free", "k", "--start", "k=3,m=2"], 2, "unknown free parameter 'm'"),
    ([*FIT, "--free", "k", "--start", "fmus"], 2, "fmus holds no result of a fit: name its folder or its fit.json"),
    (["precision", "stikslip"], 2, "unknown model 'stikslip' (nearest: 'stickslip'); allowed: belt, clutch, "),
    (["sweep", "smd"], 2, "--vary"),
    (["sweep", "smd", "--vary", "mm=1:2:3"], 2, "unknown parameter to vary 'mm' (nearest: 'm')"),
    ([*SWEEP, "--vary", "m=1,2"], 2, "names a parameter twice"),
    ([*SWEEP, "--set", "m=1"], 2, "both varied and set"),
    ([*SWEEP, "--set", "k"], 2, "--set 'k' is not an assignment"),
    ([*SWEEP, "--set", "k=-1"], 2, "k = -1.0 is outside its range"),
    ([*SWEEP, "--set", "solver.method=euler"], 2, "unknown value of solver.method 'euler'"),
    ([*SWEEP, "--measures", "stuck"], 2, "unknown measure of smd 'stuck'"),
    ([*SWEEP, "--stop", "-1"], 2, "stop = -1.0 s is not after start = 0.0 s"),
    (["sweep", "stickslip", "--vary", "m=1,2", "--measures", "zeta"], 2, "unknown measure of stickslip 'zeta'"),
    (["sweep", "stickslip", "--vary", "friction=1.5,2"], 2, "friction is an enumeration"),
    (
        ["sweep", "stickslip", "--vary", "mu_d=1:2:3", "--workers", "1"],
        1,
        "all runs of the sweep failed: 3 runs, such as mu_d = 1.0: mu_d is 1.0, above",
    ),
]


@pytest.mark.parametrize(("arguments", "status", "sentence"), COMMAND_LINES)
def test_an_invalid_command_line_is_one_sentence_and_leaves_no_result(workspace, arguments, status, sentence):
    (workspace / "line.csv").write_text("t,x\n" + "".join(f"{i},{i}\n" for i in range(20)))
    result = commands.harness(workspace, *arguments)
    assert_one_sentence(result, status, sentence)
    assert [file for file in workspace.glob("results/**/*") if file.is_file()] == []


@pytest.mark.parametrize("options", [["f=0.3,solver.method=ode45"], ["f=0.3", "solver.method= 3"]])
def test_a_tolerance_applies_to_a_method_that_is_set_with_other_values(workspace, options):
    words = [word for text in options for word in ("--set", text)]
    result = commands.harness(workspace, "run", "fmus/coulomb.fmu", *words, "--rtol", "1e-5", "--stop", "0.5")
    assert (result.returncode, result.stderr) == (0, "")


def test_an_option_that_applies_to_one_of_two_fmus_is_accepted(workspace):
    other = external_fmus.build_external_fmus() / "Midpoint.fmu"
    result = commands.harness(workspace, "compare", OWN_FMU, other, "--timeout", 30, "--stop", 0.1)
    assert (result.returncode, result.stderr) == (0, "")


SCENE = 'title = "a decay"\nfmu = "{fmu}"\noutputs = ["x"]\n{more}\n'


@pytest.mark.parametrize("command", ["precision", "stability"])
def test_a_command_for_the_solver_refuses_an_external_fmu(tmp_path, command):
    folder = external_fmus.build_external_fmus()
    for name in ("Midpoint", "Fmi3Midpoint"):
        result = commands.harness(tmp_path, command, folder / f"{name}.fmu")
        assert_one_sentence(result, result.returncode, f"{name}.fmu ")
        assert result.returncode
        assert (
            " is not an FMU of this project" in result.stderr or "is not an FMI 2.0 co-simulation FMU" in result.stderr
        )


def test_the_decay_of_a_scene_of_an_external_fmu_is_identified(tmp_path):
    fmu = fmi3_fixtures.build_fmi3_fmus() / "smd.fmu"
    (tmp_path / "mine.toml").write_text(SCENE.format(fmu=fmu, more="[values]\nc = 0.4\nk = 100"))
    result = commands.harness(tmp_path, "decay", "mine.toml", COLUMNS="120")
    assert (result.returncode, result.stderr) == (0, "")
    assert "zeta" in result.stdout
    fmu = external_fmus.build_external_fmus() / "Midpoint.fmu"
    (tmp_path / "mine.toml").write_text(SCENE.format(fmu=fmu, more=""))
    result = commands.harness(tmp_path, "decay", "mine.toml")
    assert_one_sentence(result, 2, "x has no unit in Midpoint.fmu")


@pytest.mark.parametrize(("value", "hint"), [("0.3", "; write it without quotes"), ("low", "")])
def test_a_text_in_place_of_a_number_is_called_a_text(workspace, value, hint):
    scene = f'title = "a text"\nmodel = "stickslip"\noutputs = ["x"]\n[values]\nmu_s = "{value}"\n'
    (workspace / "mine.toml").write_text(scene)
    result = commands.harness(workspace, "run", "mine.toml")
    assert_one_sentence(result, 2, f"mu_s = '{value}' is a text, not a number{hint}\n")
