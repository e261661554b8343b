"""The lowered numerics: the same bits as the vector sources on arrays, removed code, and unsupported constructs."""

import ast
import re
import traceback
from inspect import isfunction, signature
from pathlib import Path

import pytest
from internal_steps import array_steps, prepared_run, scalar_steps
from models import CASES, LARGER_MODELS, MODELS, ROOT, label, model_class

from fmus.packaging import BuildError
from fmus.packaging.lowering import LoweringError, function_tree, lowered_files, lowered_model, select_features
from fmus.packaging.lowering.emit_source import SourceEmitter
from fmus.packaging.lowering.layout import ModelLayout
from fmus.packaging.lowering.lowered_sources import lower_all, runtime_symbols
from fmus.packaging.lowering.scalarize import fold_zero
from fmus.packaging.lowering.source_symbols import SourceSymbols
from fmus.packaging.model_lookup import find_model
from fmus.runtime import stick_slip
from fmus.runtime.vectors import ContactIndex, ContactVector, StateVector

NUMERICS = ("step_control.py", "stick_slip.py", "integrator.py")
STEPS = 150  # of a run, enough for some events
VECTORS, DECLARATIONS = ((ROOT / "fmus" / "runtime" / name).read_text() for name in ("vectors.py", "oscillator.py"))
EVERY_MODEL = pytest.mark.parametrize("name", MODELS)


@pytest.mark.parametrize("case", CASES, ids=label)
def test_arrays_and_scalars_give_the_same_bits_at_every_step(case):
    name, values, stop = case
    scalars = scalar_steps(model_class(name)(), values, stop, STEPS)
    assert scalars == array_steps(find_model(name).model(), values, stop, STEPS)
    assert scalars


@pytest.mark.parametrize("path", [*MODELS, *LARGER_MODELS], ids=str)
def test_the_runtime_declares_each_generated_method_with_its_arguments(path):
    model, checked = find_model(path).model, set()
    components = {StateVector: model.states, ContactVector: model.contacts, ContactIndex: ()}
    for name, function in vars(model).items():
        if isfunction(function) and name != "__init__":
            declared = next(vars(base)[name] for base in model.__mro__[1:] if name in vars(base))
            types = declared.__annotations__
            expected = [
                one for word in signature(declared).parameters for one in components.get(types.get(word), [word])
            ]
            assert list(signature(function).parameters) == expected
            checked.add(name)
    assert {"prepare", "initial_state", "rates", "jacobian", "compute_outputs"} <= checked


@EVERY_MODEL
def test_emitted_code_has_no_vectors_names_its_source_and_keeps_the_line_length(name):
    for path, text in lowered_files(name).items():
        tree = ast.parse(text)
        names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
        assert not names & {
            "StateVector",
            "RateVector",
            "ContactVector",
            "contact_indices",
            "slip_index",
            "velocity_indices",
        }, path
        source = ROOT / "fmus" / path
        if path != f"{name}.py" and source.read_text() != text:
            states = ", ".join(model_class(name).states)
            first, *_ = text.splitlines()
            assert first.startswith(f"# Generated for {states}")
            assert f" from fmus/{path} of" in first
        if path != f"{name}.py":
            assert [line for line in text.splitlines() if len(line) > 120] == [], path


def test_unreachable_code_is_removed():
    """A smooth model has no modes, one without closed form no closed-form code, and a selection nothing else."""
    smooth, dry = (
        "\n".join(text for path, text in lowered_files(name).items() if path.split("/")[-1] in NUMERICS)
        for name in ("pacejka", "coulomb")
    )
    for word in (
        "def update_end_modes",
        "def advance_stuck",
        ".is_hybrid",
        ".has_consistent_modes",
        "mode0",
        "def advance_linear_segment",
    ):
        assert word not in smooth
        assert word in dry
    for word in ("from .contact_lcp", "model.is_coupled"):  # of a contact that is stuck while something moves
        assert word not in dry


@EVERY_MODEL
def test_a_traceback_points_into_the_source(name):
    model = model_class(name)()
    run = prepared_run(model, {})
    with pytest.raises(TypeError) as caught:
        run.solver.start(model, 0.0, *model.initial_state(0.0), "never", 1e-6)
    frame = traceback.extract_tb(caught.value.__traceback__)[-1]
    assert frame.filename == str(ROOT / "fmus" / "runtime" / "integrator.py")
    assert frame.line == "duration = t_end - t if t_end < inf else model.stop_time"


HEAD = """class Some:
    y1: StateVector
    f1: RateVector

    def step(self, model, modes: ContactVector, t, y: StateVector, f: RateVector, h):
        """
SPEC = ModelLayout({"x": "v", "v": "a"}, {"mode": "v"})
BODIES = {
    "z = y + h * f\n        f = model.rates(t, z, modes)": "evaluates f at other states than before",
    "z = y + h * f\n        step.f1 = model.rates(t, z, modes)": "at other states than their class declares",
    "slopes = model.rates(t, step.y1, modes)": "at states without a name",
    "z = y + h * f\n        slopes = model.rates(t, z, modes)\n        z = y": "changes under slopes",
    "y2 = y + h * model.rates(t, y, modes)": "assign it to a name on a separate line",
    "e = magnitude(y + f)": "would evaluate its argument twice",
    "e = y + f\n        e += y": "write c = c + ...",
    "if y > 0.0:\n            t = 0.0": "is a vector where a scalar is required",
    "j = 1\n        t = y[j]": "is an index that is not known at build time",
    "e = y + modes": "loop over contact_indices",
    "y = y + h * f": "changes under f",
    "self.f2 = f": "declare it in its class",
    "modes = contact_vector()": "write modes = 0 * modes",
    "y2 = y + h * f\n        v2 = t": "uses v2 for a scalar",
}


@pytest.mark.parametrize("body", BODIES)
def test_an_unsupported_construct_is_refused_with_file_line_and_remedy(body):
    text = HEAD + body + "\n"
    with pytest.raises(LoweringError, match=re.escape(BODIES[body])) as caught:
        SourceEmitter(SPEC, SourceSymbols([text, DECLARATIONS], VECTORS), "runtime/some.py", text, True)
    assert re.match(r"runtime/some\.py:[5678]: ", str(caught.value))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        *(("a + 0.0", "a"), ("a - 0.0", "a"), ("a * 0.0", "0.0"), ("0.0 * a", "0.0"), ("0.0 * 0.0", "0.0")),
        *((text, text) for text in ("0.0 - a", "0.0 + a", "0.0 / a", "a + 1.0", "a - b", "a * b")),
    ],
)
def test_operations_with_components_that_are_always_zero_are_simplified(text, expected):
    e = ast.parse(text, mode="eval").body
    assert ast.unparse(fold_zero(e.left, e.op, e.right)) == expected


def test_rates_and_states_may_have_any_names():
    text = HEAD + "z = y + h * f\n        slope = model.rates(t, z, modes)\n        e = slope - f\n        return e\n"
    lines = SourceEmitter(SPEC, SourceSymbols([text, DECLARATIONS], VECTORS), "runtime/some.py", text, True).lines
    assert [line.strip() for line in lines[-7:]] == [
        "z_x = x + h * v",
        "z_v = v + h * a",
        "slope_v = model.rates(t, z_x, z_v, mode)",
        "e_x = z_v - v",  # the rate of the position is the speed
        "e_v = slope_v - a",
        "return e_x, e_v",
        "",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("class A:\n    b: StateVector\nclass C:\n    b: ContactVector\n", "another vector"),
        ("class A:\n    b: StateVector\nclass C:\n    def f(self):\n        self.b = 0.0\n", "C does not declare b"),
        ("class A:\n    f0: RateVector\n", "follows no StateVector"),
    ],
)
def test_an_attribute_has_one_declared_type(text, message):
    with pytest.raises(BuildError, match=message):
        SourceSymbols([text], VECTORS)


@pytest.mark.parametrize(
    ("states", "mode", "separator"),
    [
        ({"x": "v", "x1": "v1", "v": "a", "v1": "a1"}, "mode", "_"),
        ({"x": "v", "x2": "v2", "v": "a", "v2": "b"}, "mode1", "_"),
        ({"x": "v", "x2": "v2", "v": "a", "v2": "x_2"}, "mode", "__"),
        ({"x": "v", "x_end": "b", "v": "a"}, "mode", "_"),
        ({"x1": "v1", "x2": "v2", "v1": "a1", "v2": "a2"}, "mode", ""),
    ],
)
def test_states_keep_their_names_beside_stages_of_other_states(states, mode, separator):
    symbols, names = runtime_symbols(), {*states, *states.values(), mode}
    assert symbols.stage_separator(states, [mode]) == separator
    assert symbols.resolve_names(states, [mode], separator) == {name: name for name in names}


def test_a_model_is_lowered_only_once():
    assert lowered_model("smd") is lowered_model("smd")


@EVERY_MODEL
def test_every_compound_statement_keeps_the_number_of_its_source_line(name):
    """Error messages and comments in C name these lines, also where lowering has rewritten the test."""
    rewritten = 0
    for path, lines in lower_all(find_model(name), select_features(find_model(name))).items():
        if not path.startswith("runtime/"):
            continue
        source = (ROOT / "fmus" / path).read_text(encoding="utf-8").split("\n")
        for line in lines:
            word = line.split()[0].rstrip(":") if line.strip() else ""
            if word in ("if", "while", "def", "class") and line.endswith(":"):
                original = source[line.source - 1].split()[0].rstrip(":")
                assert {word, original} <= {"if", "elif", "else", "for"} or word == original, (path, line)
                rewritten += line.strip() != source[line.source - 1].strip()
    assert rewritten > 5


def test_the_tree_of_a_function_has_the_line_numbers_of_its_file():
    source = Path(stick_slip.__file__).read_text(encoding="utf-8").split("\n")
    for function in (stick_slip.threshold, stick_slip.DryFriction.slip_acceleration, stick_slip.resolve_mode):
        tree = function_tree(function)
        assert source[tree.lineno - 1].strip().startswith(f"def {function.__name__}(")
        last = tree.body[-1]
        assert source[last.lineno - 1].strip() == ast.unparse(last)


def test_an_elif_becomes_an_if_where_the_branch_before_is_removed_and_other_tests_are_copied():
    text = """
def f(model, x):
    if x < 1e-3:  # as it is written
        return 0
    if model.has_driver:
        return 1
    elif x > 1.0:
        return 2
    return 3
"""
    spec = ModelLayout({"x": "v", "v": "a"}, {"mode": "v"}, {"has_driver": False})
    lines = SourceEmitter(spec, SourceSymbols([text, DECLARATIONS], VECTORS), "runtime/some.py", text, True).lines
    assert lines[2:4] == ["    if x < 1e-3:  # as it is written", "        return 0"]
    assert lines[4:] == ["    if x > 1.0:", "        return 2", "    return 3", ""]
