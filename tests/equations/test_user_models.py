"""User models in any folder: built by path, with every backend, and correct."""

import subprocess
import sys
from zipfile import ZipFile

import commands
import numpy as np
import pytest
from build_cache import ROOT, build_user_model
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from model_text import BLOCK, PULSES
from models import EXAMPLE_MODELS, model_class
from row_comparison import assert_identical
from scipy.integrate import solve_ivp
from variants import campaign_after, slow_after
from worker_client import FmiError

from fmus.compiler import BuildError
from fmus.compiler.model_lookup import find_model
from fmus.packaging.archive import build
from fmus.packaging.model_description import REAL_ONLY_HINT
from harness import describe, simulate

EVERY_FILE = pytest.mark.parametrize("path", slow_after(1, EXAMPLE_MODELS), ids=lambda path: path.stem)
KINDS = {
    "": [],
    "native/fmi3": ["--fmi", "3", "--platform", "linux64"],
    "native": ["--native", "--platform", "linux64"],
}


def command(*arguments, cwd):
    """The build command, in a user's folder."""
    return commands.build(*arguments, folder=cwd)


def build_fmu(path, kind):
    """Return the FMU, beside a copy of the file outside the project; for FMI 3.0, whose numerics are those of the
    native FMU, with the default method only. Those of the example models are optimised, as those of users."""
    method_option = ["--method", find_model(path).analysis.method] if kind == "native/fmi3" else []
    folder = build_user_model(path, *KINDS[kind], *method_option, optimise=path in EXAMPLE_MODELS)
    return folder / kind / f"{path.stem}.fmu"


@pytest.mark.parametrize("kind", campaign_after(2, KINDS))
def test_it_is_built_beside_its_file_for_every_backend_and_is_valid(kind):
    (path,) = (path for path in EXAMPLE_MODELS if path.stem == "rotor_brake")
    fmu = build_fmu(path, kind)
    assert validate_fmu(str(fmu)) == []
    assert read_model_description(fmu).modelName == path.stem
    folder, *_ = [*kind.split("/"), ""]
    files = {file.name for file in fmu.parents[len(kind.split("/")) if kind else 0].iterdir()}
    assert files == {path.name, folder or f"{path.stem}.fmu"}
    with ZipFile(fmu) as archive:
        names = archive.namelist()
        assert "documentation/index.html" in names
        assert not [name for name in names if name == "model.png" or "fmi-ls-ref" in name]


@EVERY_FILE
def test_python_and_native_agree_bit_for_bit(path, worker):
    """Outputs and counters, up to the stop time of the default run."""
    description = read_model_description(build_fmu(path, ""))
    names = [v.name for v in description.modelVariables if v.causality == "output" or v.name == "solver.steps"]
    stop = float(description.defaultExperiment.stopTime)
    times = [stop * i / 50 for i in range(51)]
    rows = []
    for kind in ("", "native"):
        fmu = worker.instantiate(build_fmu(path, kind)).begin({}, stop=stop)
        rows.append(fmu.run(times, names))
        fmu.free()
    assert_identical(*rows, names)


def viscous_pendulum(t, y):
    phi, omega = y
    return [omega, -9.81 / 0.5 * np.sin(phi) - 0.05 / 0.25 * omega]


def bumper(t, y):
    x, v = y
    w, p = v / 0.05, (x - 0.02) / 0.01
    drag = 3.0 * np.tanh(w) * (1.0 - 0.4 * np.cos(w) * np.exp(-(w**2)))
    push = 3.0 * (np.sinh(p) + np.log(1.0 + p)) if p > 0.0 else 0.0
    return [v, (8.0 - drag - push) / 2.0]


@pytest.mark.parametrize(("law", "start"), slow_after(1, [(bumper, (0.0, 0.1)), (viscous_pendulum, (0.3, 0.0))]))
def test_its_motion_agrees_with_an_independent_formulation(law, start):
    """Within 1e-9, by scipy's DOP853."""
    path = next(path for path in EXAMPLE_MODELS if path.stem == law.__name__)
    stop = model_class(path).stop_time
    values = {"solver.rtol": 1e-11, "solver.method": 4}
    simulation = simulate_fmu(
        build_fmu(path, "native"), stop_time=stop, output_interval=stop / 100, start_values=values
    )
    x, v = (s.name for s in find_model(path).analysis.states)
    true = solve_ivp(law, (0.0, stop), start, "DOP853", t_eval=simulation["time"], rtol=1e-12, atol=1e-13).y
    assert np.abs(simulation[x] - true[0]).max() < 1e-9
    assert np.abs(simulation[v] - true[1]).max() < 1e-8


def rotor_brake(stop):
    """Return times and angles of the changes between stick and slip of the brake, by scipy with events."""
    J, k, c, T_s, T_d, omega_s, turn = 0.02, 3.0, 0.01, 0.5, 0.3, 0.5, 0.4
    t, phi, changes = 0.0, 0.0, []

    def slide(t, y):
        drag = T_d + (T_s - T_d) * np.exp(-((y[1] / omega_s) ** 2))
        return [y[1], (k * (turn * t - y[0]) - c * y[1] - drag) / J]

    def rest(t, y):
        return y[1]

    rest.terminal, rest.direction = True, -1
    while True:
        t = (T_s / k + phi) / turn
        if t > stop:
            return changes
        changes.append((t, phi))
        run = solve_ivp(slide, (t, stop), (phi, 0.0), "DOP853", events=rest, rtol=1e-12, atol=1e-13)
        if run.status != 1:
            return changes
        t, (phi, _) = run.t[-1], run.y[:, -1]
        changes.append((t, phi))


def test_its_friction_sticks_and_slips_when_the_equations_require(worker):
    """The events of the brake, and a rest."""
    path = next(path for path in EXAMPLE_MODELS if path.stem == "rotor_brake")
    stop = model_class(path).stop_time
    fmu = worker.instantiate(build_fmu(path, "native")).begin({"solver.rtol": 1e-11, "solver.method": 4}, stop=stop)
    t, events = 0.0, []
    while t < stop:
        ahead = fmu.get("solver.t_next")
        fmu.step(t, ahead - t)
        t = ahead
        count, last, phi, omega, grip = fmu.get("events.count", "events.t_last", "phi", "omega", "grip")
        if count > len(events):
            events.append((last, phi))
        if grip == 0:
            assert omega == 0.0
    fmu.free()
    true = rotor_brake(stop)
    assert len(events) == len(true) > 6
    assert np.abs(np.array(events) - np.array(true)).max() < 1e-8


def test_methods_laws_and_folders_are_selected_for_a_file_as_for_a_name(tmp_path):
    path = next(path for path in EXAMPLE_MODELS if path.stem == "rotor_brake")
    run = command(path, "--method", "rodas", "--law", "hybrid", "--platform", "linux64", "--out", "lean", cwd=tmp_path)
    assert (run.returncode, run.stderr) == (0, "")
    fmu = describe(tmp_path / "lean" / "rotor_brake.fmu")
    assert (fmu.methods, fmu.laws) == (("rodas",), ("hybrid",))
    refusal = command(path, "--method", "exact", cwd=tmp_path)
    assert refusal.stderr == "Error: rotor_brake has no method 'exact'; it has ode23, ode45, dop853, rodas, radau9.\n"


@pytest.fixture
def oil(tmp_path):
    """A folder with a model file that is named like a built-in model."""
    path = next(path for path in EXAMPLE_MODELS if path.stem == "viscous_pendulum")
    (tmp_path / "pendulum.py").write_text(path.read_text())
    return tmp_path


TABLE = "# series and DOP853, relative difference 1e-13\nt [s],phi [rad],omega [rad/s]\n0.0,0.3,0.0\n4.0,0.1,-0.2\n"


def test_files_of_the_same_stem_are_packed_and_no_others(oil):
    """Icon and certified result; neither is required, whatever the name."""
    assert command("pendulum.py", cwd=oil).returncode == 0
    with ZipFile(oil / "pendulum.fmu") as archive:
        assert not [name for name in archive.namelist() if name == "model.png" or "fmi-ls-ref" in name]
    icon = (ROOT / "fmus" / "smd.png").read_bytes()
    (oil / "pendulum.png").write_bytes(icon)
    (oil / "pendulum.csv").write_text(TABLE)
    assert command("pendulum.py", cwd=oil).returncode == 0
    with ZipFile(oil / "pendulum.fmu") as archive:
        assert archive.read("model.png") == icon
        result = archive.read("extra/org.fmi-standard.fmi-ls-ref/pendulum_out.csv").decode()
        page = archive.read("documentation/index.html").decode()
    assert result.splitlines() == ["time,phi,omega", "0.0,0.3,0.0", "4.0,0.1,-0.2"]
    assert "Certified result of the default experiment: series and DOP853, relative difference 1e-13." in page


@pytest.mark.campaign
def test_a_model_file_may_be_named_like_a_python_module(oil):
    """For example math.py or fmus.py: the commands do not import them instead of the module."""
    folder = oil / "Modelle für später"
    folder.mkdir()
    for name in ("math.py", "fmus.py", "random.py"):
        (folder / name).write_bytes(b"\xef\xbb\xbf" + (oil / "pendulum.py").read_bytes().replace(b"\n", b"\r\n"))
    for words in ("build_fmus", "fmus.py"), ("harness", "run", "fmus.fmu"):
        result = subprocess.run([sys.executable, "-m", *words], cwd=folder, capture_output=True, text=True, timeout=300)
        assert result.returncode == 0, result.stderr


def harness(*arguments, cwd):
    """A harness command in a user's folder, without figures."""
    return commands.harness(cwd, *arguments)


def test_a_result_is_certified_by_two_agreeing_methods_and_packed_by_the_next_build(oil):
    assert harness("references", "pendulum.py", cwd=oil).stderr == (
        "Error: there is no pendulum.fmu: build it with `friction-fmus build pendulum.py`\n"
    )
    assert command("pendulum.py", cwd=oil).returncode == 0
    process = harness("references", "pendulum.py", cwd=oil)
    assert (process.returncode, process.stderr) == (0, "")
    comment, heads, *rows = (oil / "pendulum.csv").read_text().splitlines()
    assert comment.startswith("# dop853 and rodas, relative difference ")
    assert float(comment.rsplit(" ", 1)[1]) < 1e-10
    assert heads == "t [s],phi [rad],omega [rad/s]"
    t, phi, omega = np.array([row.split(",") for row in rows], float).T
    true = solve_ivp(viscous_pendulum, (0.0, t[-1]), (0.3, 0.0), "DOP853", t_eval=t, rtol=1e-12, atol=1e-13).y
    assert np.abs(true - [phi, omega]).max() < 1e-9
    assert command("pendulum.py", "--method", "rodas", cwd=oil).returncode == 0
    with ZipFile(oil / "pendulum.fmu") as archive:
        assert "extra/org.fmi-standard.fmi-ls-ref/pendulum_out.csv" in archive.namelist()
    message = harness("references", "pendulum.py", cwd=oil).stderr
    assert "pendulum.fmu does not offer dop853: build it without --method" in message


DUFFING = '''
from fmus import Model, Output, Parameter, State, cos

class Duffing(Model):
    """Forced mass between two wells."""

    w = Parameter(1.2, "rad/s", "frequency of the force")
    u = Parameter(1.0, "1/s", "unit of rates")
    x = State("1", "position", start=0.1)
    v = State("1/s", "speed", rate_of=x)
    phase = State("rad", "phase of the force", rate=w)
    a = Output("1/s2", "acceleration", u * (u * (x - x * x * x + 0.5 * cos(phase)) - 0.3 * v), rate_of=v)
    stop_time, method = 250.0, "dop853"
'''
LIMIT = BLOCK.replace('1.5, "N"', '1.99999999999975, "N"')  # the spring pulls with the friction force where it stops


@pytest.mark.parametrize(
    ("text", "reason"),
    slow_after(
        1, [(DUFFING, "differ by "), (LIMIT, "find different changes of mode, so the result is not certified: ")]
    ),
    ids=["chaos", "limit of friction"],
)
def test_a_run_on_which_two_methods_disagree_is_not_certified(oil, text, reason):
    """A result that depends on rounding."""
    (oil / "case.py").write_text(text)
    assert command("case.py", cwd=oil).returncode == 0
    run = harness("references", "case.py", cwd=oil)
    assert run.returncode == 1
    assert run.stderr.startswith(f"Error: case.py: dop853 and rodas {reason}")
    assert not (oil / "case.csv").exists()


@pytest.mark.slow
def test_a_pulse_that_both_methods_miss_is_not_certified(oil):
    (oil / "pulses.py").write_text(PULSES)
    assert command("pulses.py", cwd=oil).returncode == 0
    for method in ("dop853", "rodas"):
        motion = simulate(oil / "pulses.fmu", {"solver.method": method}, rtol=1e-12, progress=False)
        assert motion["x"][-1] == 0.0
    run = harness("references", "pulses.py", cwd=oil)
    assert run.returncode == 1
    assert run.stderr.startswith("Error: pulses.py: dop853 with a thirtieth of the largest step differs by ")
    assert not (oil / "pulses.csv").exists()


def test_an_invalid_result_is_refused(oil):
    tables = ["", "t,x\n0,1\n", TABLE.replace("# ", ""), TABLE.replace(",0.3,", ",nan,"), TABLE.replace(",-0.2", "")]
    for table in tables:
        (oil / "pendulum.csv").write_text(table)
        with pytest.raises(
            BuildError, match=r"pendulum\.csv is not a certified result: line 1 must state after a # how"
        ):
            build(oil / "pendulum.py", oil)
    run = command("pendulum.py", cwd=oil)
    assert run.returncode == 1
    assert run.stderr.startswith("Error: pendulum.csv is not a certified result: ")
    assert run.stderr.count("\n") == 1


def test_a_run_shows_events_whatever_the_name_of_the_mode(tmp_path):
    fmu = build_fmu(next(path for path in EXAMPLE_MODELS if path.stem == "rotor_brake"), "")
    (tmp_path / "brake.toml").write_text(f'title = "Brake"\nfmu = "{fmu}"\noutputs = ["phi", "omega", "alpha"]\n')
    run = harness("run", "brake.toml", "--out", "results", cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    header, *rows = (tmp_path / "results" / "brake" / "events.csv").read_text().splitlines()
    assert header == "t [s],mode"
    assert [int(row.split(",")[1]) for row in rows[:4]] == [0, 1, 0, 1]


@pytest.mark.parametrize("words", [["run"], ["precision"], ["stability"], ["references"], ["compare", "brake.py"]])
def test_every_command_takes_its_path_and_explains_how_to_build_it(tmp_path, words):
    (tmp_path / "brake.py").write_text("")
    result = harness(*words, "brake.py", cwd=tmp_path)
    assert result.returncode
    assert result.stderr.count("\n") == 1
    assert "there is no brake.fmu: build it with `friction-fmus build brake.py`" in result.stderr


def test_it_is_run_and_compared_by_its_path_like_its_fmu(tmp_path):
    source = next(path for path in EXAMPLE_MODELS if path.stem == "rotor_brake")
    for path in (source, build_fmu(source, "")):
        (tmp_path / path.name).symlink_to(path)
    harness("run", "rotor_brake.py", cwd=tmp_path)
    assert "the same, bit for bit" in harness("run", "rotor_brake.fmu", cwd=tmp_path).stdout
    result = harness("compare", "rotor_brake.py", "rotor_brake.fmu", "--atol", "0", "--stop", "1", cwd=tmp_path)
    assert result.returncode == 0, result.stderr


PUCK = '''
from fmus import Contact, Mode, Model, Output, Parameter, State


class Puck(Model):
    """Puck on ice, with its speed as the only state: m a = -F."""

    m = Parameter(2.0, "kg", "mass", above=0.0)
    f = Parameter(3.0, "N", "force of dry friction", low=0.0)
    grip = Parameter(4.0, "N", "what holds")
    v = State("m/s", "speed", start=1.0)
    mode = Mode()
    F = Contact("N", "friction, against the motion", mode=mode, slip=v, slide=f, hold=grip)
    a = Output("m/s2", "acceleration", -F / m, rate_of=v)
'''


@pytest.fixture
def puck(tmp_path):
    """A model file with one state."""
    (tmp_path / "puck.py").write_text(PUCK)
    return tmp_path / "puck.py"


@pytest.mark.parametrize("kind", slow_after(1, ["", "native"]))
def test_a_model_may_have_one_state(puck, kind):
    """It slows by f / m, and comes to rest after m / f."""
    run = simulate_fmu(
        str(build_fmu(puck, kind)), stop_time=1.0, output_interval=0.25, output=["v", "mode", "events.t_last"]
    )
    assert np.abs(run["v"] - np.maximum(0.0, 1.0 - 1.5 * run["time"])).max() < 1e-12
    assert (run["mode"][-1], run["events.t_last"][-1]) == (0, pytest.approx(2.0 / 3.0, abs=1e-12))


@pytest.mark.parametrize("kind", ["", "native"])
def test_sliding_friction_above_static_friction_is_refused_before_the_run(puck, worker, kind):
    """It could neither stay nor go: as built, and when a value is set."""
    sentence = "F: the sliding force exceeds the holding force (f = {}, grip = {}): lower slide or raise hold"
    fmu = worker.instantiate(build_fmu(puck, kind))
    puck.write_text(PUCK.replace("(4.0", "(2.0"))
    result = command("puck.py", cwd=puck.parent)
    assert (result.returncode, result.stdout) == (1, "")
    assert sentence.format(3.0, 2.0) in result.stderr
    with pytest.raises(FmiError):
        fmu.begin({"f": 5.0}, stop=1.0).step(0.0, 1.0)
    assert sentence.format(5.0, 4.0) in str(fmu.messages())
    fmu.free()


DRIVING = {
    "f": "F: the sliding force is negative with f = -2.0: set values with which it is at least 0",
    "grip": "F: the holding force is negative with grip = -2.0: set values with which it is at least 0",
    "m": "F: the force accelerates its own slip with m = -2.0: set values with which it opposes the slip",
}


def run_with_a_change(fmu, before, during):
    """Make two steps, with values that are set before the first and before the second."""
    fmu.begin(before, stop=1.0).step(0.0, 0.1)
    fmu.set(during)
    fmu.step(0.1, 0.1)


@pytest.mark.parametrize("kind", slow_after(1, ["", "native"]))
def test_parameters_with_which_friction_drives_are_refused(puck, worker, kind):
    """Where no range of the parameter excludes them: before the run, and during it."""
    puck.write_text(PUCK.replace(", low=0.0", "").replace(", above=0.0", ""))
    for name, sentence in DRIVING.items():
        for before, during in ({name: -2.0}, {}), ({}, {name: -2.0}):
            fmu = worker.instantiate(build_fmu(puck, kind))
            with pytest.raises(FmiError):
                run_with_a_change(fmu, before, during)
            assert sentence in str(fmu.messages())
            fmu.free()


SPECIAL = r"""??= ??/ ??' ??( ??) ??! ??< ??> ??- ???/ " \ \n %s %n { </p> & ' ]]> --> */ /* // é ∂ 漢"""
TEXTS = f"""
from fmus import Contact, Mode, Model, Output, Parameter, Rule, State

TEXT = {SPECIAL!r}


class Texts(Model):
    __doc__ = TEXT

    m = Parameter(1.0, "kg", TEXT, above=0.0)
    k = Parameter(100.0, "N/m", TEXT)
    k_max = Parameter(200.0, "N/m", TEXT)
    f = Parameter(1.0, "N", TEXT, low=0.0)
    x = State("m", TEXT, start=0.1)
    v = State("m/s", TEXT, rate_of=x)
    mode = Mode(TEXT)
    F_friction = Contact("N", TEXT, mode=mode, slip=v, slide=f)
    a = Output("m/s2", TEXT, (-k * x - F_friction) / m, rate_of=v)
    rules = Rule(k > k_max, "{{k!r}} " + TEXT.replace("{{", "{{{{"))
"""


@pytest.mark.parametrize("kind", campaign_after(1, KINDS))
def test_any_printable_text_survives_in_every_backend(kind, tmp_path, worker):
    """Trigraphs, delimiters and format fields of C, XML and Python; in descriptions and messages."""
    (tmp_path / "texts.py").write_text(TEXTS, encoding="utf-8")
    result = command("texts.py", *KINDS[kind], "--method", "ode45", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    description = read_model_description(tmp_path / kind / "texts.fmu")
    names = ("m", "k", "k_max", "f", "x", "v", "mode", "F_friction", "a")
    texts = {v.name: v.description for v in description.modelVariables if v.name in names}
    assert description.description == f"{SPECIAL} {REAL_ONLY_HINT}"
    assert texts == dict.fromkeys(names, SPECIAL) | {"mode": f"mode of F_friction: {SPECIAL}"}
    if kind == "native/fmi3":
        return  # its messages are those of the other native FMU
    for values, message in (
        ({"m": -1.0}, f"m = -1.0 kg is refused: {SPECIAL} must be above 0.0 kg"),
        ({"k": 300.0}, f"300.0 {SPECIAL}"),
    ):
        fmu = worker.instantiate(tmp_path / kind / "texts.fmu")
        with pytest.raises(FmiError):
            fmu.begin(values, stop=1.0).step(0.0, 1.0)
        assert message in [text for *_, text in fmu.messages()]
        fmu.free()


DIVISORS = '''
from fmus import Fixed, Model, Output, Parameter, State, choose


class Divisors(Model):
    """Mass on a spring with outputs that divide."""

    m = Parameter(1.0, "kg", "mass")
    k = Parameter(100.0, "N/m", "stiffness")
    scale = Parameter(1.0, "m", "length that divides")
    gap = Parameter(1.0, "m", "length that divides unless it is 0")
    F_0 = Fixed(10.0, "N", "force at the start")
    x = State("m", "position", start=F_0 / k)
    v = State("m/s", "speed", rate_of=x)
    a = Output("m/s2", "acceleration", -k * x / m, rate_of=v)
    ratio = Output("1", "ratio", x / (2.0 * scale * scale) * scale)
    share = Output("1", "share", choose(gap > 0.0, x / gap, 0.0))
    slope = k / gap  # of parameters only
    steepness = Output("N/m2", "steepness", choose(gap > 0.0, slope, 0.0))
'''


@pytest.mark.parametrize("kind", slow_after(1, ["", "native"]))
def test_a_parameter_that_divides_is_refused_at_zero(kind, tmp_path, worker):
    """With its name, unless choose() excludes the division."""
    (tmp_path / "divisors.py").write_text(DIVISORS)
    path = build_user_model(tmp_path / "divisors.py", *KINDS[kind], "--method", "ode45") / kind / "divisors.fmu"
    for name, owner in ("m", "a"), ("k", "x"), ("scale", "ratio"):
        fmu = worker.instantiate(path)
        with pytest.raises(FmiError):
            fmu.begin({name: 0.0}, stop=1.0).step(0.0, 1.0)
        assert f"{name} = 0.0 is refused: {owner} divides by {name}" in str(fmu.messages())
        fmu.free()
    fmu = worker.instantiate(path).begin({"gap": 0.0}, stop=1.0)
    fmu.step(0.0, 1.0)
    assert fmu.get("share", "steepness") == [0.0, 0.0]
    fmu.free()
