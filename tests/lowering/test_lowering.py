"""The lowered numerics: the same bits as the vector sources on lists, removed code, and unsupported constructs."""

import ast
import traceback
from inspect import isfunction, signature
from itertools import product
from pathlib import Path

import pytest
from internal_steps import list_steps, prepared_run, scalar_steps
from models import CASES, LARGER_MODELS, MODELS, ROOT, label, model_class, scalar_class

from fmus.compiler import BuildError
from fmus.compiler.lowering import function_tree, lowered_files, lowered_model, select_features
from fmus.compiler.lowering.layout import ModelLayout, component_name
from fmus.compiler.lowering.lowered_modules import lower_all, remove_unused_code
from fmus.compiler.lowering.module_lowering import FileLowerer
from fmus.compiler.lowering.scalarize import fold_zero
from fmus.compiler.lowering.vector_symbols import SourceSymbols
from fmus.compiler.model_lookup import find_model
from fmus.compiler.syntax_trees import TranslationError
from fmus.runtime import stick_slip
from fmus.runtime.vectors import ContactIndex, ContactVector, StateVector

NUMERICS = (
    *("step_control.py", "internal_step.py", "rest_step.py", "closed_form_step.py", "method_step.py", "step_end.py"),
    *("stick_slip.py", "integrator.py"),
)
STEPS = 150  # of a run, enough for some events
VECTORS, DECLARATIONS = ((ROOT / "fmus" / "runtime" / name).read_text() for name in ("vectors.py", "oscillator.py"))
EVERY_MODEL = pytest.mark.parametrize("name", MODELS)


@pytest.mark.parametrize("case", CASES, ids=label)
def test_lists_and_scalars_give_the_same_bits_at_every_step(case):
    name, values, stop = case
    scalars = scalar_steps(model_class(name)(), values, stop, STEPS)
    assert scalars == list_steps(find_model(name), values, stop, STEPS)
    assert scalars


@pytest.mark.parametrize("path", [*MODELS, *LARGER_MODELS], ids=str)
def test_the_runtime_declares_each_generated_method_with_its_arguments(path):
    model, checked_names = scalar_class(path), set()
    components = {StateVector: model.states, ContactVector: model.contacts, ContactIndex: ()}
    for name, function in vars(model).items():
        if isfunction(function) and name != "__init__":
            declaration = next(vars(base)[name] for base in model.__mro__[1:] if name in vars(base))
            types = declaration.__annotations__
            expected = [
                component
                for word in signature(declaration).parameters
                for component in components.get(types.get(word), [word])
            ]
            assert list(signature(function).parameters) == expected
            checked_names.add(name)
    assert {"prepare", "initial_state", "rates", "jacobian", "compute_outputs"} <= checked_names


@EVERY_MODEL
def test_emitted_code_has_no_vectors_and_names_its_source(name):
    for path, text in lowered_files(name).items():
        tree = ast.parse(text)
        names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
        assert not names & {
            "StateVector",
            "ContactVector",
            "contact_indices",
            "slip_index",
            "velocity_indices",
        }, path
        first, states = text.splitlines()[0], ", ".join(model_class(name).states)
        assert first.startswith(f"# Generated for {states}")
        assert f" from fmus/{path} of" in first


def test_unreachable_code_is_removed():
    """A smooth model has no modes, one without closed form no closed-form code, and a selection nothing else."""
    smooth, dry = (
        "\n".join(text for path, text in lowered_files(name).items() if path.split("/")[-1] in NUMERICS)
        for name in ("pacejka", "coulomb")
    )
    for word in (
        "def update_end_modes",
        "def advance_stuck",
        "def resolve_mode",
        "modes0_",
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
    with pytest.raises(TypeError) as error:
        run.solver.start(model, 0.0, *model.initial_state(0.0), "never", 1e-6)
    frame = traceback.extract_tb(error.value.__traceback__)[-1]
    assert frame.filename == str(ROOT / "fmus" / "runtime" / "integrator.py")
    assert frame.line == "duration = t_end - t if t_end < inf else model.stop_time"


HEAD = """class Some:
    y1: StateVector
    f1: StateVector

    def step(self, model, modes: ContactVector, t, y: StateVector, f: StateVector, h):
        """
SPEC = ModelLayout({"x": "v", "v": "a"}, {"mode": "v"})
BODIES = [  # of functions that mean something else component by component
    "y2 = y + h * model.rates(t, y, modes)",
    "e = magnitude(y + f)",
    "e = y + f\n        e += y",
    "if y > 0.0:\n            t = 0.0",
    "j = 1\n        t = y[j]",
    "e = y + modes",
    "return model.rates(t, y, modes)",
    "self.f2 = f",
    "modes = contact_vector()",
    "y2 = y + h * f\n        y2_end = t",
]


def lower(text, spec):
    """Return the lines of a file of the runtime, lowered."""
    tree = FileLowerer(spec, SourceSymbols([text, DECLARATIONS], VECTORS), "runtime/some.py", text, True).tree
    return ast.unparse(ast.fix_missing_locations(tree)).split("\n")


@pytest.mark.parametrize("body", BODIES)
def test_an_unsupported_construct_is_refused_with_file_and_line(body):
    with pytest.raises(TranslationError, match=r"^runtime/some\.py:[5678]: '.*' cannot be translated"):
        lower(HEAD + body + "\n", SPEC)


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


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("", ["e_x = z_v - f_x"]),  # the rate of the position is the speed
        ("z[1] = 0.0", ["slope_x = z_v", "z_v = 0.0", "e_x = slope_x - f_x"]),
        ("slope = f", ["slope_x = z_v", "slope_x = f_x", "slope_v = f_v", "e_x = slope_x - f_x"]),
    ],
)
def test_rates_that_are_states_are_copied_where_one_of_both_changes(change, expected):
    lines = ["z = y + h * f", "slope = model.rates(t, z, modes)", change, "e = slope - f", "return e"]
    text = HEAD + "\n        ".join(line for line in lines if line) + "\n"
    assert [line.strip() for line in lower(text, SPEC)[3:]] == [
        "z_x = y_x + h * f_x",
        "z_v = y_v + h * f_v",
        "slope_v = model.rates(t, z_x, z_v, modes_mode)",
        *expected,
        "e_v = slope_v - f_v",
        "return (e_x, e_v)",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("class A:\n    b: StateVector\nclass C:\n    b: ContactVector\n", "another vector"),
        ("class A:\n    b: StateVector\nclass C:\n    def f(self):\n        self.b = 0.0\n", "C does not declare b"),
    ],
)
def test_an_attribute_has_one_declared_type(text, message):
    with pytest.raises(BuildError, match=message):
        SourceSymbols([text], VECTORS)


def test_a_model_is_lowered_only_once():
    assert lowered_model("smd") is lowered_model("smd")


@EVERY_MODEL
def test_every_statement_keeps_the_number_of_its_source_line(name):
    """Error messages and comments in C name these lines, also where lowering has rewritten the statement."""
    words = {
        ast.If: ("if ", "elif ", "for "),
        ast.While: ("while ",),
        ast.ClassDef: ("class ",),
        ast.Return: ("return",),
    }
    n_rewritten = 0
    for path, tree in lower_all(find_model(name), select_features(find_model(name))).items():
        if not path.startswith("runtime/"):
            continue
        source = (ROOT / "fmus" / path).read_text(encoding="utf-8").split("\n")
        for node in ast.walk(tree):
            if type(node) in words:
                line = source[node.lineno - 1].strip()
                assert line.startswith(words[type(node)]), (path, node.lineno)
                n_rewritten += not ast.unparse(ast.fix_missing_locations(node)).startswith(line)
    assert n_rewritten > 5


def test_the_tree_of_a_function_has_the_line_numbers_of_its_file():
    source = Path(stick_slip.__file__).read_text(encoding="utf-8").split("\n")
    for function in (stick_slip.threshold, stick_slip.DryFriction.slip_acceleration, stick_slip.resolve_mode):
        tree = function_tree(function)
        assert source[tree.lineno - 1].strip().startswith(f"def {function.__name__}(")
        last = tree.body[-1]
        assert source[last.lineno - 1].strip() == ast.unparse(last)


def test_a_branch_that_a_model_never_takes_is_removed_and_other_tests_stay():
    text = """
def f(model, x):
    if x < 1e-3:
        return 0
    if model.has_driver:
        return 1
    elif x > 1.0:
        return 2
    return 3
"""
    spec = ModelLayout({"x": "v", "v": "a"}, {"mode": "v"}, {"has_driver": False})
    assert lower(text, spec)[1:] == [
        *("    if x < 0.001:", "        return 0"),
        *("    if x > 1.0:", "        return 2", "    return 3"),
    ]


@pytest.mark.parametrize("name", ["x_end", "end", "e_x", "y_", "_v", "x__v"])
def test_components_of_two_vectors_never_have_the_same_name(name):
    vectors = ["y", "y_end", "e", "e_end", "_f_t"]
    names = [component_name(vector, state) for vector in vectors for state in (name, "x", "v", "x_v", "end_x")]
    names += [component_name("J", *pair) for pair in product((name, "x", "v", "x_v"), repeat=2)]
    assert len({*names}) == len(names)


def test_functions_and_imports_that_nothing_uses_are_removed():
    texts = {
        "runtime/slave.py": "from .a import f\nf(solver.step)\ndef unused():\n    pass\n",
        "runtime/a.py": "from .b import g, h\ndef f():\n    g.k()\ndef unused():\n    h()\n",
        "some.py": "class Some(Base):\n    def step(self):\n        pass\n    def other(self):\n        pass\n",
    }
    files = remove_unused_code({path: ast.parse(text) for path, text in texts.items()})
    assert {path: ast.unparse(tree) for path, tree in files.items()} == {
        "runtime/slave.py": ast.unparse(ast.parse(texts["runtime/slave.py"])),
        "runtime/a.py": "from .b import g\n\ndef f():\n    g.k()",
        "some.py": "class Some(Base):\n\n    def step(self):\n        pass",
    }
