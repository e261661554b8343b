"""Models with more states or contacts, from user files, against independent formulations."""

import commands
import numpy as np
import pytest
from build_cache import build_user_model
from contact_references import CONTACT_REFERENCES, reference_events, solve_lugre
from fmpy import read_model_description
from models import LARGER_MODELS, write_growing_friction_model
from row_comparison import assert_identical
from variants import slow_after
from worker_client import FmiError

STOP, DOP853 = 8.0, 4


def built(name, kind):
    """Return the FMU of one of the files, in a folder outside the project."""
    (file,) = (file for file in LARGER_MODELS if file.stem == name)
    return build_user_model(file, *(["--native", "--platform", "linux64"] if kind else [])) / kind / f"{name}.fmu"


def test_three_states_agree_with_an_independent_formulation(worker):
    """LuGre: position, speed and bristle deflection, within 1e-9 of their size."""
    fmu = worker.instantiate(built("lugre", "")).begin({"solver.rtol": 1e-11}, stop=STOP)
    (final,) = fmu.run([0.0, STOP], ["x", "v", "z"])[-1:]
    fmu.free()
    assert np.abs(final - solve_lugre(STOP)).max() < 1e-9


@pytest.mark.slow
def test_a_certified_result_has_all_states_and_precision_accepts_it(tmp_path):
    """LuGre, with its own column names."""
    folder = built("lugre", "").parent
    for file in ("lugre.py", "lugre.fmu"):
        (tmp_path / file).write_bytes((folder / file).read_bytes())
    done = commands.harness(tmp_path, "references", "lugre.py")
    assert (done.returncode, done.stderr) == (0, "")
    _, heads, *rows = (tmp_path / "lugre.csv").read_text().splitlines()
    assert heads == "t [s],x [m],v [m/s],z [m]"
    table = np.array([row.split(",") for row in rows], float)
    assert np.abs(table[-1, 1:] - solve_lugre(table[-1, 0])).max() < 1e-9
    done = commands.harness(tmp_path, "precision", "lugre.py", "--quick")
    assert (done.returncode, done.stderr) == (0, "")
    assert [file.name for file in (tmp_path / "results/precision").iterdir()] == ["lugre"]
    expected_files = {"data.npz", "points.csv", "figure.svg", "provenance.json", "summary.json"}
    assert {file.name for file in (tmp_path / "results/precision/lugre").iterdir()} == expected_files


def run(fmu, physics, changes):
    """Return time and modes of the events and the final state, stepping to every internal step, with changes of
    values."""
    t, events = 0.0, []

    def record_event():
        count, *event = fmu.get("events.count", "events.t_last", *physics.modes)
        if count > len(events):
            events.append(event)

    for end, name, value in (*changes, (physics.stop, "", 0.0)):
        while t < end:
            ahead = min(fmu.get("solver.t_next"), end)
            fmu.step(t, ahead - t)
            t = ahead
            record_event()
        if name:
            fmu.set({name: value})
            record_event()
    return events, fmu.get(*physics.states)


CHANGED = [(name, one.changes) for name, one in CONTACT_REFERENCES.items() if one.changes]
RUNS = [*((name, ()) for name in CONTACT_REFERENCES), *CHANGED]


@pytest.mark.parametrize(
    ("name", "changes"), slow_after(3, RUNS), ids=lambda one: one if isinstance(one, str) else f"changed{len(one)}"
)
def test_contacts_stick_and_slip_as_in_an_independent_formulation(worker, name, changes):
    """On a belt, in a clutch, on separate bodies or shared ones: every event and the final state; also with a change
    of the belt speed and an opening of the clutch."""
    physics = CONTACT_REFERENCES[name]()
    true, end = reference_events(name, changes)
    fmu = worker.instantiate(built(name, ""))
    fmu.begin({"solver.rtol": 1e-12, "solver.method": DOP853}, stop=physics.stop)
    events, final = run(fmu, physics, changes)
    fmu.free()
    assert [modes for _, *modes in events] == [modes for _, *modes in true]
    assert np.abs(np.array([t for t, *_ in events]) - [t for t, *_ in true]).max() < 1e-9
    assert np.abs(np.array(final) - end).max() < 1e-9


@pytest.mark.slow  # builds every model twice
@pytest.mark.parametrize("name", [path.stem for path in LARGER_MODELS])
def test_python_and_native_agree_bit_for_bit(worker, name):
    """Outputs and counters at every internal step, by every method."""
    variables = {v.name: v for v in read_model_description(built(name, "")).modelVariables}
    names = [v.name for v in variables.values() if v.causality == "output"]
    names += ["solver.steps", "solver.evaluations", "events.count"][: 3 if name in CONTACT_REFERENCES else 2]
    methods = [int(item.value) for item in variables["solver.method"].declaredType.items]
    assert len(methods) > 3
    stop = 3.0  # after several events
    for method in methods:
        runs = []
        for kind in ("", "native"):
            fmu = worker.instantiate(built(name, kind)).begin({"solver.rtol": 1e-5, "solver.method": method}, stop=stop)
            runs.append(fmu.follow(0.0, stop, names))
            fmu.free()
        (times, rows), (same, others) = runs
        assert times == same
        assert_identical(rows, others, names)


@pytest.mark.parametrize("kind", ["", pytest.param("native", marks=pytest.mark.slow)])
def test_a_sled_with_more_sliding_than_static_friction_is_reported_in_one_sentence(tmp_path, worker, kind):
    words = ["--native", "--platform", "linux64", "--method", "ode45"] if kind else []
    fmu = worker.instantiate(
        build_user_model(write_growing_friction_model(tmp_path), *words) / kind / "growing.fmu"
    ).begin({"slide1": 200.0}, stop=STOP)
    with pytest.raises(FmiError):
        fmu.step(0.0, STOP)
    ((_, _, sentence),) = [message for message in fmu.messages() if message[0] != 0]
    assert sentence.startswith("F1: the sliding force exceeds the holding force at t = 0.0 s (hold - slide = -89.6")
    assert np.isnan(fmu.get("x1"))
    fmu.free()
