"""Models with large equations build in a time that follows their size, or the build refuses them in one sentence."""

import inspect
import math
import sys
from contextlib import contextmanager

import pytest
from models import scalar_class
from variants import campaign_after

from fmus.compiler import BuildError
from fmus.compiler.equations.model_file import load_model_file
from fmus.compiler.lowering import lowered_files, lowered_model, select_features
from fmus.packaging.native.native_fmu import collect_sources

MODEL = '''
from fmus import *


class Large(Model):
    """Block on a spring with friction: m a = F - F_friction."""

    m = Parameter(1.0, "kg", "mass", above=0)
    k = Parameter(100.0, "N/m", "stiffness", low=0)
    L = Parameter(1.0, "m", "length", above=0)
    f = Parameter(2.0, "N", "friction", low=0)
    x = State("m", "position", start=0.1)
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    r = x / L
    values = [r]
    for i in range({n}):
        values.append({step})
    F_friction = Contact("N", "friction force", mode=mode, slip=v, slide={slide})
    a = Output("m/s2", "acceleration", ({force} - F_friction) / m, rate_of=v)
'''
SPRING, LAST, TOTAL = "-k * x", "-k * L * values[-1]", "k * L * sum(values) - k * x"
NEWTON = "values[-1] - (values[-1] * values[-1] * values[-1] + values[-1] - r) / (3.0 * values[-1] * values[-1] + 1.0)"
SHAPES = {  # step, force, sliding force
    "sum": ("sin(0.01 * i + r)", TOTAL, "f"),
    "product": ("values[-1] * (1.0 + 0.001 * sin(0.01 * i + r))", LAST, "f"),
    "nested function": ("sin(values[-1])", LAST, "f"),
    "Newton steps": (NEWTON, LAST, "f"),
    "Newton steps in the friction": (NEWTON, SPRING, "f * (1.0 + values[-1] * values[-1])"),
    "shared cases": ("choose(values[-1] > 0.1 * i, 0.5 * values[-1] + 1.0, 0.25 * values[-1])", LAST, "f"),
    "many conditions": ("choose(r > 0.1 * i, r - 0.1 * i, 0.0)", TOTAL, "f"),
    "exponential functions": ("exp(-values[-1] * values[-1])", LAST, "f"),
    "outputs": ("vars().setdefault(f'y{i}', Output('1', 'ratio', 0.5 * values[-1] + r))", LAST, "f"),
}
N = 8


def write_model(folder, shape, n):
    step, force, slide = SHAPES[shape]
    path = folder / f"large_{n}.py"
    path.write_text(MODEL.format(n=n, step=step, force=force, slide=slide), encoding="utf-8")
    return load_model_file(path)


def count_calls(function):
    """Return how many Python functions a call runs, those of the standard library included."""
    n_calls = 0

    def count(frame, event, argument):
        nonlocal n_calls
        n_calls += event == "call"

    previous = sys.getprofile()
    sys.setprofile(count)
    try:
        function()
    finally:
        sys.setprofile(previous)
    return n_calls


@contextmanager
def shallow_stack(depth):
    """Let Python call at most `depth` functions from within one another in this context."""
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(len(inspect.stack(0)) + depth)
    yield
    sys.setrecursionlimit(limit)


@pytest.mark.parametrize("shape", campaign_after(3, SHAPES))
def test_work_grows_no_faster_than_n_log_n(tmp_path, shape):
    """Work that does not depend on n is subtracted by differences: w(4n) - w(2n) over w(2n) - w(n)."""
    work = []
    for n in (N, 2 * N, 4 * N):
        source = write_model(tmp_path, shape, n)
        work.append(count_calls(lambda source=source: source.generated_source))
    limit = (4 * math.log(4 * N) - 2 * math.log(2 * N)) / (2 * math.log(2 * N) - math.log(N))
    assert (work[2] - work[1]) / (work[1] - work[0]) < limit


@pytest.mark.campaign
def test_lowering_and_translation_grow_no_faster_than_n_log_n(tmp_path):
    """The first translation of a process fills caches, and is not counted."""
    work = []
    for n in (N, N, 2 * N, 4 * N):
        source = write_model(tmp_path, "Newton steps", n)
        features = select_features(source, ("ode45",), ())

        def translate(source=source, features=features):
            lowered_files(source, features)
            collect_sources(lowered_model(source, features), "2")

        work.append(count_calls(translate))
    limit = (4 * math.log(4 * N) - 2 * math.log(2 * N)) / (2 * math.log(2 * N) - math.log(N))
    assert (work[3] - work[2]) / (work[2] - work[1]) < limit


@pytest.mark.parametrize("shape", campaign_after(1, ["sum", "nested function", "shared cases"]))
def test_equations_deeper_than_the_stack_of_python_build(tmp_path, shape):
    """The rate has the value that Python calculates; all conditions of a new model object hold."""
    n = 350
    with shallow_stack(300):
        model = scalar_class(write_model(tmp_path, shape, n))()
        model.prepare()
    step, force, _ = SHAPES[shape]
    values = [0.1]
    names = {"values": values, "r": 0.1, "k": 100.0, "L": 1.0, "x": 0.1, "sin": math.sin}
    names["choose"] = lambda condition, value, other_value: value
    for i in range(n):
        values.append(eval(step, names | {"i": i}))
    assert model.rates(0.0, 0.1, 1.0, 1) == pytest.approx(eval(force, names) - 2.0, rel=1e-14)


def test_the_order_of_operations_stays_as_written(tmp_path):
    """Long sums are split into statements without regrouping, so that no bit changes."""
    n, x = 300, 0.1
    model = scalar_class(write_model(tmp_path, "sum", n))()
    model.prepare()
    total = 0 + x / 1.0
    for i in range(n):
        total = total + math.sin(0.01 * i + x / 1.0)
    assert model.rates(0.0, x, 1.0, 1) == (100.0 * 1.0 * total - 100.0 * x - 2.0) / 1.0


@pytest.mark.campaign
def test_5000_terms_are_translated_to_c(tmp_path):
    source = write_model(tmp_path, "sum", 5000)
    texts = collect_sources(lowered_model(source, select_features(source, (), ())), "2")
    assert texts["model.h"].count("sin(") >= 5000


def test_a_chain_of_too_many_cases_is_refused(tmp_path):
    path = tmp_path / "cases.py"
    step = "choose(r < 0.001 * i, i * r, values[-1])"
    path.write_text(MODEL.format(n=200, step=step, force=LAST, slide="f"), encoding="utf-8")
    with pytest.raises(BuildError, match=r"line 18: more than 40 choose\(\).*nest them by halves"):
        load_model_file(path).generated_source  # noqa: B018


def test_cases_that_share_branches_are_refused_before_they_multiply(tmp_path, monkeypatch):
    monkeypatch.setattr("fmus.compiler.equations.expression_printer.MAX_LINES", 2000)
    path = tmp_path / "multiplied.py"
    step = "choose(r > 0.1 * i, 2.0 * values[-1], r) + choose(v > 0.0, 3.0 * values[-1], r)"
    path.write_text(MODEL.format(n=30, step=step, force=LAST, slide="f"), encoding="utf-8")
    with pytest.raises(BuildError, match=r"a method of this model would have more than 2000 lines"):
        load_model_file(path).generated_source  # noqa: B018


def test_many_choices_do_not_multiply(tmp_path):
    """Each choice in a rate once doubled the lines of its method."""
    declarations = "".join(
        f'    c{i} = Choice("choice {i}", one="first", two="second")\n'
        f"    values.append(c{i}.choose(one=r, two=2.0 * r))\n"
        for i in range(12)
    )
    text = MODEL.format(n=0, step="r", force=TOTAL, slide="f")
    head, marker, tail = text.partition("    F_friction")
    path = tmp_path / "choices.py"
    path.write_text(f"{head}{declarations}{marker}{tail}", encoding="utf-8")
    source = load_model_file(path)
    assert source.generated_source.count("\n") < 600
    model = scalar_class(source)()
    model.c3 = 2
    model.prepare()
    assert model.rates(0.0, 0.1, 1.0, 1) == pytest.approx(100.0 * 14 * 0.1 - 10.0 - 2.0, rel=1e-14)


def test_messages_about_long_equations_are_short(tmp_path):
    path = tmp_path / "units.py"
    path.write_text(MODEL.format(n=500, step="sin(r + i)", force="sum(values)", slide="f"), encoding="utf-8")
    with pytest.raises(BuildError, match="mixes units") as error:
        load_model_file(path).analysis  # noqa: B018
    assert len(str(error.value)) < 1000
