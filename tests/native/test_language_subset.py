"""Every construct of the subset behaves in C as in CPython, bit for bit."""

import math

import pytest

from tests.native.compiled_methods import PAIRS, CompiledMethods, assert_same_as_python

THIRD, FEW = 1.0 / 3.0, 3


def half(x):
    """A function of a module."""
    return 0.5 * x


class Part:
    def __init__(self):
        self.total = 0.0
        self.calls = 0

    def take(self, x):
        self.calls += 1
        self.total += x
        return self.total

    def count(self):
        self.calls += 1


class Base:
    smooth, kind = True, 1

    def shape(self, x):
        return x * x

    def half_shape(self, x):
        return half(self.shape(x))


class AllowedConstructs(Base):
    """One method for each construct."""

    kind = 2

    def __init__(self):
        self.a, self.b = 1.5, -0.25
        self.n = 3
        self.on = False
        self.row = [1.0, 2.0, 4.0]
        self.left, self.right = Part(), Part()

    def shape(self, x):
        return super().shape(x) + 1.0

    def arithmetic(self, x, y):
        return x + y - x * y - (x - y) - -x + 2 * y - (x + 1) * -(y - 3.0), x - (y - (x - y)), -(x * y) / 8.0

    def division(self, x, y):
        return x / y + self.a / (x - y) / (THIRD / y)

    def power(self, x, y):
        return x**2 + y**-THIRD if y > 0.0 else x**3.0

    def folding(self, x, y):
        return x * (2.0 * math.pi / 3.0) + math.sin(0.7) * 0.5 - 2**0.5 + y * -FEW

    def total_functions(self, x, y):
        return math.fabs(x) + math.atan(y), math.copysign(x, y), math.atan2(x, y), math.tanh(x)

    def trigonometry(self, x, y):
        return math.sin(x) * math.cos(y) + math.tan(x)

    def inverse(self, x, y):
        return math.asin(x) - math.acos(y)

    def hyperbolic(self, x, y):
        return math.sinh(x) + math.cosh(y)

    def exponential(self, x, y):
        return math.exp(x) + math.expm1(y)

    def logarithm(self, x, y):
        return math.log(x) + math.log1p(y)

    def roots(self, x, y):
        return math.sqrt(x) + math.pow(x, y) + math.fmod(x, y)

    def tests(self, x, y):
        return math.isfinite(x), math.isnan(y), math.isinf(x * y), math.isfinite(x) and not math.isnan(y)

    def conversion(self, x, y):
        return float(self.n) * x, int(self.row[2]) + self.n

    def comparisons(self, x, y):
        return x < y, x <= y, x > y, x >= y, x == y, x != y, self.n == 3, (x < y) == (y < x)

    def chains(self, x, y):
        return self.b < x <= y < self.a, 0.0 < x / y < 1.0

    def logic(self, x, y):
        return (x > 0.0 and y > 0.0) or not (x < y and self.on), x != 0.0 and 1.0 / x > y

    def conditional(self, x, y):
        return 1 if x > y else -1 if x < y else 0, (x if x > 0.0 else y) * 2.0, 1.0 / x if y > 0.0 else 0.0

    def arithmetic_pair(self, x, y):
        return x + y, x - y

    def division_pair(self, x, y):
        return x / y, y / x

    def branches(self, x, y):
        if x > y:
            z = x
        elif x < y / self.b:
            z = y
            self.on = True
        elif self.n == 3 and y == 0.0:
            return 1.0
        else:
            z = self.a
        if math.isnan(z):
            self.n = -1
        return z

    def constants_of_a_class(self, x, y):
        return x if self.smooth and self.kind == 2 else y

    def endless_loop(self, x, y):
        tries = 0
        while True:
            x = half(x)
            tries += 1
            if not math.fabs(x) > math.fabs(y) + 1e-3 or tries == 40:
                result = x
                break
        return result, tries

    def guarded_loop(self, x, y):
        remaining = 30
        while True:
            if not (remaining > 0 and 1.0 / x < y):
                break
            x = x * 0.75
            remaining -= 1
            self.a += x
        return x, remaining

    def effects_in_a_test(self, x, y):
        while True:
            if not self.left.take(x) < y or self.left.calls > 20:
                break
        if self.right.take(y) / x > 1.0:
            self.b = x
        return self.left.total

    def counted_loops(self, x, y):
        for i in range(FEW):
            self.row[i] = self.row[i] * x + i * y
            if self.row[i] > 1e3:
                break
        for _ in range(1, self.n):
            self.a -= y
        return self.row[0], self.row[-1]

    def elements(self, x, y):
        i = -5
        for _ in range(10):
            if i < x:
                i += 1
        self.a = 9.0
        self.row[i] = y / x
        return self.row[i] + self.row[2]

    def simultaneous_assignments(self, x, y):
        self.a, self.b = self.b, self.a
        self.b, x, self.a = x, y, x / self.b
        x, y = y, x
        return x, y

    def chained_assignments(self, x, y):
        self.a = self.b = z = x * y
        self.n = m = 4
        self.left.total = z - half(y)
        return z, m

    def several_results(self, x, y):
        p, _ = self.arithmetic_pair(x, y)
        self.a, self.b = self.division_pair(p, y)
        return self.arithmetic_pair(self.a, self.b)

    def in_place(self, x, y):
        x += y
        self.a -= x
        self.b *= self.a
        self.row[1] /= y
        self.left.calls += 2
        return x

    def parts(self, x, y):
        part = self.left
        part.take(x)
        self.right.take(part.total)
        part.count()
        z = self.half_shape(y)
        return z, part.take(y)

    def effects_before(self, x, y):
        return x * self.left.take(y) + 1.0

    def effects_in_order(self, x, y):
        return self.left.take(x), self.left.take(y)

    def effects_then_fault(self, x, y):
        self.left.take(x)
        self.a = 1.0 / y
        self.b = 7.0
        return self.left.take(y)

    def effects_after_a_fault(self, x, y):
        return self.left.take(x / y)

    def nested_return(self, x, y):
        if self.left.take(x) > 0.0:
            return self.effects_then_fault(x, y)
        self.n += 1
        return math.log(y)


METHODS = [
    name
    for name in vars(AllowedConstructs)
    if callable(vars(AllowedConstructs)[name]) and name not in ("__init__", "shape")
]


@pytest.fixture(scope="module")
def compiled_methods(tmp_path_factory):
    return CompiledMethods(AllowedConstructs(), METHODS, tmp_path_factory.mktemp("allowed"))


@pytest.mark.parametrize("name", METHODS)
def test_a_construct_behaves_as_in_python(compiled_methods, name):
    assert_same_as_python(compiled_methods, AllowedConstructs(), name, PAIRS)
