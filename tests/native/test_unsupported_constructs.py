"""Constructs that C evaluates otherwise, or not at all, are refused with their line; all models are in the subset."""

import math

import pytest
from models import MODELS, model_class

from fmus.compiler.c.c_types import FLOAT
from fmus.compiler.c.call_graph import CallGraph
from fmus.compiler.c.struct_layout import AttributeTypeError
from fmus.compiler.syntax_trees import TranslationError
from fmus.packaging.native.native_fmu import collect_sources
from tests.native.test_language_subset import THIRD, AllowedConstructs, Part, half


def with_default(x, y=1.0):
    return x + y


def count_call(part):
    part.count()


def recurse(x):
    return recurse(x)


def exception_caught(self, x, y):
    try:
        return x / y
    except ZeroDivisionError:
        return 0.0


def identity(self, x, y):
    return x is y


def floor_division(self, x, y):
    return x // y


def remainder(self, x, y):
    return x % y


def ints_divided(self, x, y):
    return self.n / self.n


def bool_added(self, x, y):
    return x + (x > y)


def number_as_truth(self, x, y):
    return x if y else 0.0


def number_in_logic(self, x, y):
    return x > 0.0 and y


def smallest(self, x, y):
    return min(x, y)


def unknown_attribute(self, x, y):
    return self.unheard_of


def born_late(self, x, y):
    self.late = x
    return y


def int_where_a_float_was(self, x, y):
    self.a = 0
    return x


def float_where_an_int_was(self, x, y):
    z = 1
    z = x
    return z + y


def object_where_a_number_was(self, x, y):
    self.a = self.left
    return x


def two_kinds(self, x, y):
    return x if x > y else 1


def two_returns(self, x, y):
    if x > y:
        return x
    return 1


def may_end(self, x, y):  # noqa: RET503
    if x > y:
        return x


def may_have_no_value(self, x, y):
    if x > y:
        z = x
    return z


def may_have_no_value_after_a_loop(self, x, y):
    for i in range(self.n):
        z = i * x
    return z


def effects_after_reading(self, x, y):
    return self.a + self.left.take(x)


def effects_after_a_fault(self, x, y):
    return 1.0 / y + self.left.take(x)


def effects_sometimes(self, x, y):
    return self.left.take(x) if x > y else y


def effects_in_logic(self, x, y):
    return x > y and self.left.take(x) > 0.0


def call_in_a_chain(self, x, y):
    return x < half(y) < 1.0


def loop_with_a_test(self, x, y):
    while x > y:
        x = x - 1.0
    return x


def loop_with_steps(self, x, y):
    for _ in range(0, 9, 2):
        x = x + y
    return x


def by_name(self, x, y):
    return math.copysign(x, y=y)


def default_argument(self, x, y):
    return with_default(x)


def several_passed_on(self, x, y):
    return half(self.arithmetic_pair(x, y))


def nothing_used(self, x, y):
    return x + count_call(self.left)


def recursion(self, x, y):
    return recurse(x)


def element_outside(self, x, y):
    return self.row[3]


def element_by_a_float(self, x, y):
    return self.row[x]


def word_of_c(self, x, y):
    double = x + y
    return double + y


def constants_that_fail(self, x, y):
    return x + 1.0 / (THIRD - THIRD)


FORBIDDEN_CONSTRUCTS = [
    f
    for f in list(vars().values())
    if getattr(f, "__code__", None) and f.__code__.co_varnames[:3] == ("self", "x", "y")
]


@pytest.mark.parametrize("function", FORBIDDEN_CONSTRUCTS, ids=lambda function: function.__name__)
def test_an_unsupported_construct_is_refused_with_its_line(function):
    with pytest.raises(
        TranslationError, match=r"^test_unsupported_constructs\.py:\d+: '.*' cannot be translated"
    ) as refusal:
        CallGraph(AllowedConstructs()).add_model_entry_point("entry", function, FLOAT, FLOAT)
    line = int(str(refusal.value).split(":")[1])
    assert 0 <= line - function.__code__.co_firstlineno < 8 or function.__name__ == "recursion"


def owner(**attributes):
    return type("Owner", (), {"__init__": lambda self: vars(self).update(attributes)})()


SHARED_PART, OTHER_PART = Part(), Part()
OTHER_PART.extra = 1.0


@pytest.mark.parametrize(
    ("part", "path"),
    [
        *((owner(a=value), "Owner.a") for value in (None, "text", [], [1.0, 2], (1.0,), math.sin)),
        (owner(p=SHARED_PART, q=SHARED_PART), "Owner.q"),
        (owner(p=Part(), q=OTHER_PART), "Owner.q"),
        (owner(long=1.0), "Owner.long"),
    ],
)
def test_an_object_without_plain_data_is_refused_by_attribute_name(part, path):
    with pytest.raises(AttributeTypeError, match=f"^{path} cannot be translated to C; "):
        CallGraph(part)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_is_in_the_subset(name):
    assert "static" in collect_sources(model_class(name), "2")["model.h"]
