"""The models of fmus/more: certified results, events, packaging, and the same bits from every kind of FMU."""

import commands
import numpy as np
import pytest
from build_cache import ROOT, build_once
from fmpy.validation import validate_fmu
from models import DOP853, scalar_class
from native_fmus import require_compiler
from row_comparison import assert_identical

from benchmarks.references import event_located, plane
from fmus.compiler.model_lookup import more_model_names
from fmus.runtime.variable_declarations import exported_name, variables
from harness.references.certified_reference import event_time_error, load_reference, relative_errors

MORE = ROOT / "fmus" / "more"
OSCILLATORS = [name for name in more_model_names() if name != "spring"]  # which only couples FMUs
KINDS = {"python": (), "native": ("--native",), "fmi3": ("--fmi", "3")}
IN_CI = ("belt", "joint", "lugre", "spring", "puck")  # one contact, coupled, none, none that sticks, in a plane
EVERY_KIND = [
    pytest.param(name, kind, marks=pytest.mark.campaign if kind != "python" and name not in IN_CI else ())
    for name in more_model_names()
    for kind in KINDS
]
LAWS = {"hyperbola": (1, event_located.Belt), "stribeck": (2, event_located.StribeckBelt)}
LAWS |= {"coulomb": (3, event_located.CoulombBelt)}


def build_fmu(name, kind="python"):
    """Return the FMU of a model of fmus/more."""
    if kind == "python":
        return build_once("--more") / f"{name}.fmu"
    require_compiler()
    return build_once(name, *KINDS[kind], "--platform", "linux64") / f"{name}.fmu"


def states(name):
    """Return the names of the states that the solver integrates."""
    return [*scalar_class(name)().states]


def follow_events(fmu, names, stop):
    """Return time and modes of every change of mode, stepping to every internal step."""
    t, events = 0.0, []
    while t < stop:
        ahead = min(fmu.get("solver.t_next"), stop)
        fmu.step(t, ahead - t)
        t = ahead
        count, *event = fmu.get("events.count", "events.t_last", *names)
        if count > len(events):
            events.append(event)
    return events


def mode_names(name):
    """Return the names of the modes of the contacts."""
    return [*scalar_class(name)().contacts]


@pytest.mark.parametrize("name", OSCILLATORS)
def test_a_model_has_an_icon_and_a_certified_result_from_two_formulations(name):
    assert name in event_located.PROBLEMS or name in plane.CLOSED_FORMS
    assert MORE.joinpath(f"{name}.png").read_bytes()[:4] == b"\x89PNG"
    assert load_reference(name, MORE).estimated_error < 1e-10


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "kind"), EVERY_KIND)
def test_fmpy_validates_each_kind(name, kind):
    assert validate_fmu(str(build_fmu(name, kind))) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", OSCILLATORS)
def test_the_default_run_reproduces_the_certified_result(worker, name):
    """Within ten times the tolerance at 1e-6, and to 1e-9 at a tight one."""
    truth = load_reference(name, MORE)
    for values, bound in (({"solver.rtol": 1e-6}, 1e-4), ({"solver.rtol": 1e-12}, 1e-9)):
        fmu = worker.instantiate(build_fmu(name)).begin(values, stop=truth.times[-1])
        rows = fmu.run(truth.times.tolist(), states(name))
        fmu.free()
        assert relative_errors(np.array(rows), truth.states).max() < bound


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, problem in sorted(event_located.PROBLEMS.items()) if problem.first])
def test_events_are_those_of_the_second_formulation(worker, name):
    problem = event_located.PROBLEMS[name]()
    _, truth = event_located.solve(problem, [0.0, problem.stop], "DOP853", 3e-14, 1e-17)
    fmu = worker.instantiate(build_fmu(name)).begin({"solver.rtol": 1e-12, "solver.method": DOP853}, stop=problem.stop)
    events = follow_events(fmu, mode_names(name), problem.stop)
    fmu.free()
    assert [tuple(modes) for _, *modes in events] == [modes for _, modes in truth]
    assert np.abs(np.array([t for t, *_ in events]) - [t for t, _ in truth]).max() < 1e-10


@pytest.mark.slow
def test_the_puck_rests_when_the_closed_form_says_also_on_a_belt(worker):
    g, alpha, mu, slip_x, v_y = 9.81, 0.5, 0.6, 1.5, 0.7
    F, f = g * np.sin(alpha), mu * g * np.cos(alpha)
    stop, down, across = plane.rest(1.0, F, f, np.hypot(slip_x, v_y), np.arctan2(slip_x, -v_y))
    for belt in (0.0, 0.171, -0.8):
        values = {"alpha": alpha, "mu": mu, "mu_s": mu, "v_belt": belt, "v_x0": slip_x + belt, "v_y0": v_y}
        fmu = worker.instantiate(build_fmu("puck")).begin(values | {"solver.rtol": 1e-10}, stop=2.0)
        events = follow_events(fmu, ["mode"], 2.0)
        assert events[-1] == [pytest.approx(stop, abs=1e-9), 0]
        assert fmu.get("x", "y") == pytest.approx([across + 2.0 * belt, -down], abs=1e-9)
        fmu.free()


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_the_belt_follows_each_law(worker, law):
    number, problem = LAWS[law][0], LAWS[law][1]()
    (_, end), truth = event_located.solve(problem, [0.0, 20.0], "DOP853", 3e-14, 1e-17)
    values = {"law": number, "solver.rtol": 1e-12, "solver.method": DOP853}
    fmu = worker.instantiate(build_fmu("belt")).begin(values, stop=20.0)
    events = [(t, mode) for t, mode in follow_events(fmu, ["mode"], 20.0)]
    assert event_time_error(events, [(t, mode) for t, (mode,) in truth]) < 1e-10
    assert fmu.get("x", "v") == pytest.approx(end, abs=1e-10)
    fmu.free()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind"), [case for case in EVERY_KIND if case.values[0] in OSCILLATORS and case.values[1] != "python"]
)
def test_native_and_fmi3_agree_with_python_bit_for_bit(worker, name, kind):
    """All outputs at 101 points of the default run."""
    model = scalar_class(name)()
    names = [exported_name(*variable) for variable in variables(model) if variable[1].causality == "output"]
    times = np.linspace(0.0, type(model).stop_time, 101).tolist()
    rows = []
    for fmu in (build_fmu(name), build_fmu(name, kind)):
        fmu = worker.instantiate(fmu).begin({}, stop=times[-1])
        rows.append(fmu.run(times, names))
        fmu.free()
    assert_identical(*rows, names)


@pytest.mark.slow
def test_commands_know_the_models_by_name(tmp_path):
    listing = commands.harness(tmp_path, "info", "--json").stdout
    assert all(f'"model": "{name}"' in listing for name in OSCILLATORS)
    result = commands.harness(tmp_path, "run", "belt")
    assert "no fmus/more/belt.fmu: build it with `friction-fmus build belt`" in result.stderr
    (tmp_path / "fmus" / "more").mkdir(parents=True)
    (tmp_path / "fmus" / "more" / "belt.fmu").write_bytes(build_fmu("belt").read_bytes())
    result = commands.harness(tmp_path, "run", "belt")
    assert (result.returncode, result.stderr) == (0, "")
    assert "sticks for" in result.stdout
