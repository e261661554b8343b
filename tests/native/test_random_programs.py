"""Random programs of the subset behave in C as in CPython, bit for bit."""

import importlib.util
import random

import pytest

from tests.native.compiled_methods import PAIRS, CompiledMethods, assert_same_as_python

pytestmark = pytest.mark.slow


class Draw:
    """Generator of random source code with bounded loops; without copysign, which would reveal the sign of a NaN."""

    def __init__(self, seed):
        self.draw = random.Random(seed)
        self.loops = 0

    def number(self, depth):
        """Return a float expression."""
        if depth == 0:
            return self.draw.choice(["x", "y", "z", "self.a", "self.b", "self.left.total", "self.row[1]"])
        a, b = self.number(depth - 1), self.number(self.draw.randrange(depth))
        shapes = ["{a} + {b}", "{a} - ({b})", "({a}) * ({b})", "({a}) / ({b})", "-({a})", "({a} if {t} else {b})"]
        shapes += ["0.5 * ({a})", "({a}) / 8.0", "({a}) - 1e-3", "-3.0 / ({a})", "THIRD - ({a})"]
        shapes += ["math.sqrt({a})", "math.exp({a})", "math.sin({a})", "math.fabs({a})", "math.atan2({a}, {b})"]
        shapes += [
            "({a}) * {i}",
            "half({a})",
            "self.shape({a})",
            "({a}) ** 2",
        ]
        return self.draw.choice(shapes).format(a=a, b=b, t=self.truth(depth - 1), i=self.integer())

    def integer(self):
        return self.draw.choice(["self.n", "i", "self.left.calls", "2", "(i - self.n)", "(3 * i + 1)"])

    def truth(self, depth):
        a, b = self.number(depth), self.number(0)
        shapes = ["{a} < {b}", "{a} >= {b}", "not {a} == {b}", "{i} > i", "self.on", "{a} <= {b} < 2.0"]
        test = self.draw.choice(shapes).format(a=a, b=b, i=self.integer())
        if depth == 0 or self.draw.random() < 0.5:
            return test
        return f"({test} {self.draw.choice(['and', 'or'])} {self.truth(depth - 1)})"

    def block(self, depth, indent, loop=False):
        lines = [line for _ in range(self.draw.randint(1, 4)) for line in self.statement(depth)]
        if loop:
            test = f"if {self.truth(1)}:"
            lines += self.draw.choice([[], [test, "    break"]])
        return [" " * indent + line for line in lines]

    def statement(self, depth):
        target = self.draw.choice(["x", "y", "z", "self.a", "self.b", "self.right.total", "self.row[0]"])
        other = self.draw.choice([p for p in ("x", "y", "z", "self.a", "self.b") if p != target])
        simple = [
            lambda: f"{target} = {self.number(2)}",
            lambda: f"{target} {self.draw.choice(['+=', '-=', '*='])} {self.number(1)}",
            lambda: f"{target}, {other} = {self.number(1)}, {self.number(1)}",
            lambda: f"{target} = {other} = {self.number(2)}",
            lambda: f"{target} = self.left.take({self.number(1)})",
            lambda: f"{target}, {other} = self.arithmetic_pair({self.number(1)}, {self.number(1)})",
            lambda: f"self.on = {self.truth(1)}",
            lambda: f"self.n = {self.integer()}",
        ]
        if depth == 0 or self.draw.random() < 0.6:
            return [self.draw.choice(simple)()]
        self.loops += 1
        counter, inner = f"left{self.loops}", depth - 1
        compound = [
            lambda: [f"if {self.truth(2)}:", *self.block(inner, 4), "else:", *self.block(inner, 4)],
            lambda: [f"if {self.truth(1)}:", *self.block(inner, 4), f"elif {self.truth(1)}:", *self.block(inner, 4)],
            lambda: [f"if {self.truth(1)}:", *self.block(inner, 4), f"    return {self.number(1)}, i"],
            lambda: [f"for i in range({self.draw.randint(1, 3)}):", *self.block(inner, 4, True), "i = 1"],
            lambda: [
                f"{counter} = 3",
                "while True:",
                f"    if {counter} == 0 or {self.truth(1)}:",
                "        break",
                f"    {counter} -= 1",
                *self.block(inner, 4, True),
            ],
        ]
        return self.draw.choice(compound)()

    def method(self, name):
        body = ["        z, i = 0.25, 2", *self.block(3, 8), *self.block(2, 8)]
        return "\n".join([f"    def {name}(self, x, y):", *body, f"        return {self.number(2)}, i", ""])


@pytest.mark.campaign
def test_random_programs_behave_as_in_python(tmp_path):
    names = [f"random_{seed}" for seed in range(48)]
    text = "import math\n"
    text += "from tests.native.test_language_subset import THIRD, AllowedConstructs, half\n\n\n"
    text += "class Random(AllowedConstructs):\n"
    (tmp_path / "random_programs.py").write_text(text + "\n".join(Draw(name).method(name) for name in names))
    spec = importlib.util.spec_from_file_location("random_programs", tmp_path / "random_programs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    compiled_methods, draw = (
        CompiledMethods(module.Random(), names, tmp_path, warnings=[]),
        random.Random(2),
    )  # they make little sense
    for name in names:
        assert_same_as_python(compiled_methods, module.Random(), name, draw.sample(PAIRS, 60))
