"""Unsupported constructs are refused with their line and an alternative; all models are in the subset."""

import math
import re

import pytest
from models import MODELS, model_class

from fmus.packaging.native.c_types import FLOAT, UnsupportedConstructError
from fmus.packaging.native.call_graph import CallGraph
from fmus.packaging.native.sources import collect_sources
from tests.native.test_language_subset import THIRD, Allowed, Part, half


class Property:
    def __init__(self):
        self.a = 1.0

    @property
    def twice(self):
        return 2.0 * self.a


def with_default(x, y=1.0):
    return x + y


def nothing(part):
    part.count()


def again(x):
    return again(x)


def text(self, x, y):
    return "text"


def formatted(self, x, y):
    return f"{x}"


def no_value(self, x, y):
    return None


def list_made(self, x, y):
    z = [x, y]
    return z[0]


def dictionary(self, x, y):
    return {1: x}[1]


def comprehension(self, x, y):
    return max(z for z in (x, y))


def function_inside(self, x, y):
    def inner(z):
        return z

    return inner(x)


def lambda_inside(self, x, y):
    return (lambda z: z)(x)


def generator(self, x, y):
    yield x


def exception_caught(self, x, y):
    try:
        return x / y
    except ZeroDivisionError:
        return 0.0


def exception_raised(self, x, y):
    raise ValueError(x)


def asserted(self, x, y):
    assert x > y
    return x


def deleted(self, x, y):
    z = x
    del z
    return x


def walrus(self, x, y):
    return x if (z := y) > 0.0 else z


def identity(self, x, y):
    return x is y


def member(self, x, y):
    return x in (1.0, y)


def floor_division(self, x, y):
    return x // y


def remainder(self, x, y):
    return x % y


def bits_of_ints(self, x, y):
    return self.n | 1


def ints_divided(self, x, y):
    return self.n / self.n


def bool_added(self, x, y):
    return x + (x > y)


def number_as_truth(self, x, y):
    return x if y else 0.0


def number_negated(self, x, y):
    return not x


def number_in_logic(self, x, y):
    return x > 0.0 and y


def printed(self, x, y):
    print(x)
    return y


def python_own_function(self, x, y):
    return math.hypot(x, y)


def radians(self, x, y):
    return math.radians(x)


def rounded(self, x, y):
    return round(x)


def smallest_of_ints(self, x, y):
    return min(self.n, 4)


def one_argument(self, x, y):
    return math.copysign(x)


def unknown_name(self, x, y):
    return x + unheard_of  # noqa: F821


def unknown_attribute(self, x, y):
    return self.unheard_of


def slip_of_the_pen(self, x, y):
    return math.sinn(x)


def attribute_of_a_number(self, x, y):
    return x.real


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


def else_of_a_loop(self, x, y):
    while x > y:
        x = x - 1.0
    else:
        x = y
    return x


def loop_over_a_list(self, x, y):
    for z in self.row:
        x = x + z
    return x


def loop_with_steps(self, x, y):
    for _ in range(0, 9, 2):
        x = x + y
    return x


def by_name(self, x, y):
    return math.copysign(x, y=y)


def starred(self, x, y):
    return math.atan2(*(x, y))


def default_argument(self, x, y):
    return with_default(x)


def several_as_one(self, x, y):
    return math.fabs(self.arithmetic_pair(x, y))


def several_passed_on(self, x, y):
    return half(self.arithmetic_pair(x, y))


def several_to_three(self, x, y):
    p, q, r = self.arithmetic_pair(x, y)
    return p + q + r


def more_names_than_values(self, x, y):
    p, q = x, y, 1.0
    return p + q


def nothing_used(self, x, y):
    return x + nothing(self.left)


def no_effect(self, x, y):
    x + y
    return x


def recursion(self, x, y):
    return again(x)


def list_passed_on(self, x, y):
    return half(self.row)


def element_outside(self, x, y):
    return self.row[3]


def element_by_a_float(self, x, y):
    return self.row[x]


def word_of_c(self, x, y):
    double = x + y
    return double + y


def constants_that_fail(self, x, y):
    return x + 1.0 / (THIRD - THIRD)


def list_kept(self, x, y):
    z = self.row
    return z[0]


FORBIDDEN = [
    f
    for f in list(vars().values())
    if getattr(f, "__code__", None) and f.__code__.co_varnames[:3] == ("self", "x", "y")
]


@pytest.mark.parametrize("function", FORBIDDEN, ids=lambda function: function.__name__)
def test_an_unsupported_construct_is_refused_with_its_line_and_an_alternative(function):
    with pytest.raises(UnsupportedConstructError) as refusal:
        CallGraph(Allowed()).add_model_entry_point("entry", function, FLOAT, FLOAT)
    location, sentence = str(refusal.value).split(": ", 1)
    file, line = location.split(":")
    assert file == "test_unsupported_constructs.py"
    assert 0 <= int(line) - function.__code__.co_firstlineno < 8 or function.__name__ in (
        "recursion",
        "default_argument",
    )
    assert re.fullmatch(r"'.*' .*; .*\.", sentence, re.DOTALL), sentence


def test_a_property_is_refused():
    def use(self, x, y):
        return self.twice

    with pytest.raises(UnsupportedConstructError, match=r"'self\.twice' is neither a number nor a method of Property"):
        CallGraph(Property()).add_model_entry_point("entry", use, FLOAT, FLOAT)


def owner(**attributes):
    return type("Owner", (), {"__init__": lambda self: vars(self).update(attributes)})()


SHARED, OTHER = Part(), Part()
OTHER.extra = 1.0


@pytest.mark.parametrize(
    ("part", "words"),
    [
        (owner(a=None), "Owner.a is None"),
        (owner(a="text"), "Owner.a is 'text'"),
        (owner(a=[]), "Owner.a is []"),
        (owner(a=[1.0, 2]), "Owner.a is [1.0, 2]"),
        (owner(a=(1.0,)), "Owner.a is (1.0,)"),
        (owner(a=math.sin), "Owner.a is <built-in"),
        (owner(p=SHARED, q=SHARED), "Owner.q refers to an object that another attribute owns"),
        (owner(p=Part(), q=OTHER), "Owner.q has different attributes from another Part"),
        (owner(long=1.0), "Owner.long: long is a C keyword or macro"),
    ],
    ids=lambda part: part if isinstance(part, str) else "",
)
def test_an_object_without_plain_data_is_refused_by_attribute_name(part, words):
    with pytest.raises(UnsupportedConstructError) as refusal:
        CallGraph(part)
    assert words in str(refusal.value)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_is_in_the_subset(name):
    assert "static" in collect_sources(model_class(name), "2")["model.h"]
