"""Code is dead if no reachable code reads its symbol: a name of a module, or a member of the objects of a class."""

import ast
from difflib import ndiff

import pytest
from models import MODELS

from fmus.packaging.lowering import lowered_files, lowered_model
from fmus.packaging.lowering.dead_code import FMI_LAYER, module_of, remove_dead_code
from fmus.packaging.lowering.emit_source import SourceLine
from fmus.packaging.lowering.symbol_table import UNKNOWN, Scope, SymbolTable
from fmus.packaging.native.c_types import StructPointer
from fmus.packaging.native.call_graph import CallGraph
from fmus.packaging.native.model_header import render_model_header

MODEL = """
from .runtime.step import Step


class Some(Step):
    pass
"""


def prune(texts, *variables):
    """Remove dead code from files and return the lines of each; without a model, one that is a Step."""
    files = {
        path: [SourceLine.of(line, n) for n, line in enumerate(text.split("\n"), 1)]
        for path, text in ({"some.py": MODEL} | texts).items()
    }
    return {path: "\n".join(lines) for path, lines in remove_dead_code(files, "some.py", variables).items()}


ASSIGNMENT = """class Step:
    def __init__(self, model, step, n):
        TEXT
        self.step, self.solver = Step(model, self, 1), Step(model, self, 2)
        print(self.a, self.c)
"""


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("self.a = self.b = self.c = 0.0", "self.a = self.c = 0.0"),
        ("self.a, self.b, self.c = 1.0, 2.0, 3.0", "self.a, self.c = 1.0, 3.0"),
        ("self.a, self.b = 1.0, 2.0", "self.a = 1.0"),
        ("self.b, self.a = 1.0, 2.0", "self.a = 2.0"),
        ("self.b = 0.0  # unread", ""),
        ("self.a, self.b = [0.0] * n, [0.0] * n", "self.a = [0.0] * n"),
        ("model.solver.b = -inf", ""),
        ("step.b = x if x > 0.0 else inf", ""),
        ("step.a = step.b = step.c = 0.0", "step.a = step.c = 0.0"),
        ("self.b = x / y", "self.b = x / y"),
        ("self.b = x**2.0", "self.b = x**2.0"),
        ("self.b = x[0]", "self.b = x[0]"),
        ("self.b = find(x)", "self.b = find(x)"),
        ("find(x).b = 0.0", "find(x).b = 0.0"),
        ("self.c[0].b = 0.0", "self.c[0].b = 0.0"),
    ],
)
def test_only_unread_attributes_are_removed_from_an_assignment(text, expected):
    texts = {"runtime/step.py": ASSIGNMENT.replace("TEXT", text)}
    _, _, *lines, _, _, _ = prune(texts)["runtime/step.py"].split("\n")
    assert [line.strip() for line in lines] == [expected] * bool(expected)


def test_an_unread_attribute_goes_with_its_first_value_unless_the_fmi_layer_sets_it():
    location = """
class Location:
    def __init__(self, n):
        self.values = [0.0] * n
        self.t_last = -inf
        self.is_called = False
"""
    step = """
from .location import Location


class Step:
    def __init__(self):
        self.location = Location(1)

    def restart(self, t):
        if t > 0.0:
            self.location.t_last = t
        return self.location.values[0]
"""
    layer = "def call(model):\n    model.location.is_called = True\n    return model.restart(0.0)\n"
    pruned = prune({"runtime/location.py": location, "runtime/step.py": step, "runtime/slave.py": layer})
    assert pruned["runtime/location.py"] == location.replace("        self.t_last = -inf\n", "")
    assert pruned["runtime/step.py"] == step.replace("self.location.t_last = t", "pass")
    assert pruned["runtime/slave.py"] == layer


def test_a_function_is_removed_although_methods_and_functions_of_other_files_share_its_name():
    texts = {
        "runtime/conditions.py": "def begin(model):\n    model.sides = 1.0\n\n\ndef start(model):\n    return 1.0\n",
        "runtime/stages.py": "def begin():\n    return 0.0\n",
        "runtime/step.py": """from . import conditions
from .stages import begin as first


class Step:
    def begin(self):
        return first() + conditions.start(self)
""",
        "runtime/slave.py": "def call(model):\n    return model.begin() + model.sides\n",
    }
    pruned = prune(texts)
    assert pruned.pop("runtime/conditions.py").strip() == "def start(model):\n    return 1.0"
    assert pruned == {path: text for path, text in ({"some.py": MODEL} | texts).items() if path in pruned}


PARTS = """
class Counter:
    def __init__(self):
        self.size = 0
        self.sum = 0


class Clock:
    def __init__(self):
        self.size = 0
        self.sum = 0
"""
STEP = """
from .parts import Clock, Counter


class Step:
    def __init__(self):
        self.counter, self.clock = Counter(), Clock()
        self.size = 1

    def advance(self, counter):
        clock = self.clock
        clock.size = 2
        counter.sum = 2
        return counter.size + clock.sum
"""
LAYER = "def call(model):\n    return model.advance(model.counter)\n"


def removed_lines(step, *variables):
    """Return the lines that are removed from PARTS and from STEP."""
    texts = {"runtime/parts.py": PARTS, "runtime/step.py": step}
    pruned = prune(texts | {"runtime/slave.py": LAYER}, *variables)
    return [
        [line[2:] for line in ndiff(text.split("\n"), pruned[path].split("\n")) if line[0] == "-"]
        for path, text in texts.items()
    ]


def test_an_attribute_is_removed_although_another_class_has_a_live_one_of_its_name():
    parts, step = removed_lines(STEP)
    assert [line.strip() for line in parts] == ["self.sum = 0", "self.size = 0"]
    assert [line.strip() for line in step] == ["self.size = 1", "clock.size = 2", "counter.sum = 2"]


def test_variables_of_the_model_and_of_its_objects_are_live():
    parts, step = removed_lines(STEP, "size", "clock.size")
    assert [line.strip() for line in parts + step] == ["self.sum = 0", "counter.sum = 2"]


def test_a_name_for_objects_of_two_classes_keeps_the_attributes_of_both():
    step = STEP.replace("clock = self.clock", "clock = self.clock\n        clock = self.counter")
    assert removed_lines(step) == [[], []]


def test_a_method_that_a_base_class_calls_is_live_in_derived_classes():
    texts = {
        "runtime/base.py": "class Base:\n    def advance(self):\n        return self.rate()\n",
        "runtime/step.py": "from .base import Base\n\n\nclass Step(Base):\n    def rate(self):\n        return 1.0\n",
        "runtime/slave.py": "def call(model):\n    return model.advance()\n",
    }
    assert prune(texts) == {"some.py": MODEL} | texts


@pytest.mark.parametrize("name", MODELS)
def test_each_member_of_the_numerics_is_resolved_to_the_class_that_the_C_translator_infers(name, monkeypatch):
    trees = {module_of(path): ast.parse(text) for path, text in lowered_files(name).items()}
    table = SymbolTable(trees, name, FMI_LAYER)
    numerics = {module: tree for module, tree in trees.items() if module not in FMI_LAYER}
    for module, tree in numerics.items():
        for part in tree.body:
            scope = Scope(table, module)
            scope = scope.inside(part) if isinstance(part, ast.ClassDef) else scope
            symbols = {
                ast.unparse(node): scope.symbol(node) for node in ast.walk(part) if isinstance(node, ast.Attribute)
            }
            assert not {text for text, symbol in symbols.items() if symbol.startswith(".")}, module

    objects = set()
    add = CallGraph._add

    def record(graph, body, c_name):
        objects.update(body.local_types.items())
        for fields in graph.layout.fields.values():
            objects.update(fields.items())
        return add(graph, body, c_name)

    monkeypatch.setattr(CallGraph, "_add", record)
    render_model_header(lowered_model(name), "2")
    inferred = {(name, ctype.cls.__name__) for name, ctype in objects if isinstance(ctype, StructPointer)} - {"self"}
    resolved = {(name, table.object_classes.get(name, UNKNOWN)) for name, _ in inferred}
    assert len({name for name, owner in resolved if owner}) > 5
    assert all(
        table.object_classes.get(name, UNKNOWN) in table.classes.get(owner, [UNKNOWN]) for name, owner in inferred
    )
