"""One expression of the numerics as C text, with the kind that Python would give it.

What is known while compiling is calculated by Python itself, here.  A call with effects is taken out of its
expression and put on a line before it, which is refused where that would change what Python does.
"""

import ast
import builtins
import inspect
import math
import operator
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from types import BuiltinFunctionType, FunctionType
from typing import TYPE_CHECKING, Any, NoReturn

from .kinds import BOOL, FLOAT, INT, Group, Kind, Known, Method, Object, Row, Scalar, declare, kind_of, literal
from .refusal import Refused, refused

if TYPE_CHECKING:
    from .program import Program

# How tightly C binds; arithmetic binds in the same order in Python.
CHOICE, OR, AND, EQUALITY, ORDER, SUM, PRODUCT, SIGN, WHOLE = range(9)

TOTAL = (math.fabs, math.copysign, math.atan, math.atan2, math.tanh)  # those that never raise
PARTIAL = (
    *(math.sqrt, math.sin, math.cos, math.tan, math.asin, math.acos, math.sinh, math.cosh),
    *(math.exp, math.expm1, math.log, math.log1p, math.pow, math.fmod),
)
TESTS = (math.isfinite, math.isnan, math.isinf)
ARGUMENTS = {math.copysign: 2, math.atan2: 2, math.pow: 2, math.fmod: 2}

ARITHMETIC = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT)}
FOLDED: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
COMPARISONS: dict[type, tuple[str, int]] = {
    **{ast.Lt: ("<", ORDER), ast.LtE: ("<=", ORDER), ast.Gt: (">", ORDER), ast.GtE: (">=", ORDER)},
    **{ast.Eq: ("==", EQUALITY), ast.NotEq: ("!=", EQUALITY)},
}

LEAVE = "if (*fault) {leave}"
LASTING = re.compile(r"-?\d[\w.+-]*|-?INFINITY|NAN|true|false|_\d+")


@dataclass(frozen=True)
class Value:
    """The kind of an expression, its C text, and how tightly that binds."""

    kind: Kind
    text: str = ""
    level: int = WHOLE

    def within(self, level: int) -> str:
        """The text as an operand of an operator of that level."""
        return self.text if self.level >= level else f"({self.text})"


class Expressions(ast.NodeVisitor):
    """Expressions in the body of one function."""

    def __init__(self, program: "Program", function: FunctionType) -> None:
        self.program, self.function = program, function
        self.locals: dict[str, Kind] = {}
        self.assigned: set[str] = set()  # the names that have a value here, whatever way led here
        self.lines: list[str] = []
        self.depth = 1
        self.temporaries = count(1)
        self.pure = True
        self.faults = False  # somewhere in the function
        # of the statement at hand:
        self.faulty = False  # something in it may fault
        self.clean = True  # nothing so far that a call with effects could change or precede
        self.lazy = 0  # depth of parts that are evaluated only sometimes
        self.alone: ast.AST | None = None  # a call that needs no line of its own

    def refused(self, node: ast.AST, why: str, instead: str) -> Refused:
        return refused(self.function, node, why, instead)

    def generic_visit(self, node: ast.AST) -> NoReturn:
        raise self.refused(node, "is outside the subset", "write it with numbers, attributes, calls and if")

    def fault(self) -> str:
        """The argument by which a helper or a function can raise the fault flag."""
        self.faulty = self.faults = True
        self.clean = False
        return "fault"

    # ---- lines

    def emit(self, line: str) -> None:
        self.lines.append("    " * self.depth + line)

    def temporary(self, kind: Kind, text: str) -> str:
        """Keep a value on a line of its own."""
        name = f"_{next(self.temporaries)}"
        self.emit(f"const {declare(kind, name)} = {text};")
        return name

    def kept(self, value: Value) -> Value:
        """The same value, in a name of its own unless it is a number or has one."""
        if LASTING.fullmatch(value.text):
            return value
        return Value(value.kind, self.temporary(value.kind, value.text))

    def check(self) -> None:
        """Leave the function if the line before has raised the fault flag."""
        if self.faulty:
            self.emit(LEAVE)
        self.faulty = False

    # ---- numbers and truth

    def number(self, node: ast.expr) -> Value:
        """An expression that must be a number at run time."""
        return self.at_run_time(node, self.visit(node))

    def at_run_time(self, node: ast.AST, value: Value) -> Value:
        kind = value.kind
        if isinstance(kind, Known) and (scalar := kind_of(kind.value)):
            text = literal(kind.value)
            return Value(scalar, text, SIGN if text.startswith("-") else WHOLE)
        if not isinstance(kind, Scalar):
            raise self.refused(node, "is no number", "use a float, an int or a bool")
        return value

    def arithmetic(self, node: ast.expr, value: Value) -> Value:
        value = self.at_run_time(node, value)
        if value.kind is BOOL:
            raise self.refused(node, "is a bool in a calculation", "write 1 if ... else 0")
        return value

    def truth(self, node: ast.expr) -> Value:
        """An expression that must be a bool; what a model fixes has been settled when it was written out."""
        value = self.number(node)
        if value.kind is not BOOL:
            raise self.refused(node, "is used as a truth value", "compare it")
        return value

    # ---- names

    def visit_Constant(self, node: ast.Constant) -> Value:
        return Value(Known(node.value))

    def visit_Name(self, node: ast.Name) -> Value:
        if node.id in self.locals:
            if node.id not in self.assigned:
                raise self.refused(node, "may have no value here", "assign it on every way to this line")
            return Value(self.locals[node.id], node.id)
        for names in (self.function.__globals__, vars(builtins)):
            if node.id in names:
                return Value(Known(names[node.id]))
        raise self.refused(node, "is unknown", "assign it before")

    def visit_Attribute(self, node: ast.Attribute) -> Value:
        owner = self.visit(node.value)
        if isinstance(owner.kind, Known):
            if not hasattr(owner.kind.value, node.attr):
                raise self.refused(node, "does not exist", "look for a slip of the pen")
            return Value(Known(getattr(owner.kind.value, node.attr)))
        if not isinstance(owner.kind, Object):
            raise self.refused(node, "is an attribute of a number", "use the number itself")
        cls = owner.kind.cls
        place = f"{owner.text[1:]}.{node.attr}" if owner.text.startswith("&") else f"{owner.text}->{node.attr}"
        field = self.program.layout.fields[cls].get(node.attr)
        if isinstance(field, Object):
            return Value(field, "&" + place, SIGN)
        if field:
            self.clean = False
            return Value(field, place)
        found = inspect.getattr_static(cls, node.attr, None)
        if isinstance(found, FunctionType):
            return Value(Method(found, owner.text, cls))
        if kind_of(found):
            return Value(Known(found))
        raise self.refused(node, f"is no number and no method of {cls.__name__}", "set it in __init__")

    def visit_Subscript(self, node: ast.Subscript) -> Value:
        row, index = self.visit(node.value), self.visit(node.slice)
        if not isinstance(row.kind, Row):
            raise self.refused(node, "is no element of a list of floats", "make the list in __init__")
        if isinstance(index.kind, Known):
            if not (isinstance(index.kind.value, int) and -row.kind.length <= index.kind.value < row.kind.length):
                raise self.refused(node, f"is outside the list of {row.kind.length}", "use an index inside")
            return Value(FLOAT, f"{row.text}[{index.kind.value % row.kind.length}]")
        if index.kind is not INT:
            raise self.refused(node, "has an index that is no int", "use an int")
        place = f"element({index.text}, {row.kind.length}, {self.fault()})"
        if not self.lazy:
            place = self.temporary(INT, place)
            self.check()
        return Value(FLOAT, f"{row.text}[{place}]")

    # ---- operators

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(BOOL, "!" + self.truth(node.operand).within(WHOLE), SIGN)
        value = self.visit(node.operand)
        if isinstance(value.kind, Known) and kind_of(value.kind.value) in (FLOAT, INT):
            return Value(Known(-value.kind.value if isinstance(node.op, ast.USub) else value.kind.value))  # type: ignore[operator]
        if not isinstance(node.op, ast.USub):
            raise self.refused(node, "is outside the subset", "leave the operator out")
        return Value(self.arithmetic(node.operand, value).kind, "-" + value.within(WHOLE), SIGN)

    def visit_BinOp(self, node: ast.BinOp) -> Value:
        left, right = self.visit(node.left), self.visit(node.right)
        operation = type(node.op)
        if isinstance(left.kind, Known) and isinstance(right.kind, Known) and operation in FOLDED:
            return Value(Known(self.folded(node, FOLDED[operation], left.kind.value, right.kind.value)))
        divisor = right.kind.value if isinstance(right.kind, Known) else 0.0
        left, right = self.arithmetic(node.left, left), self.arithmetic(node.right, right)
        kind = FLOAT if FLOAT in (left.kind, right.kind) else INT
        if operation in ARITHMETIC:
            sign, level = ARITHMETIC[operation]
            return Value(kind, f"{left.within(level)} {sign} {right.within(level + 1)}", level)
        if kind is INT:
            raise self.refused(node, "calculates with two ints", "make one of them a float")
        if operation is ast.Div and divisor:
            return Value(FLOAT, f"{left.within(PRODUCT)} / {right.within(SIGN)}", PRODUCT)
        if operation is ast.Div:
            return Value(FLOAT, f"quotient({left.text}, {right.text}, {self.fault()})")
        if operation is ast.Pow:
            return Value(FLOAT, f"py_pow({left.text}, {right.text}, {self.fault()})")
        raise self.refused(node, "has an operator outside the subset", "use + - * / or **")

    def folded(self, node: ast.AST, function: Callable[..., Any], *values: object) -> object:
        """What Python calculates from known numbers."""
        if not all(kind_of(value) for value in values):
            raise self.refused(node, "calculates with what is no number", "use floats and ints")
        try:
            return function(*values)
        except (ArithmeticError, ValueError) as error:
            raise self.refused(node, f"fails: {error}", "change the constants") from error

    def visit_Compare(self, node: ast.Compare) -> Value:
        nodes = [node.left, *node.comparators]
        if any(type(op) not in COMPARISONS for op in node.ops):
            raise self.refused(node, "has an operator outside the subset", "compare numbers with < <= > >= == !=")
        for middle in nodes[1:-1]:
            if any(isinstance(part, ast.Call) for part in ast.walk(middle)):
                raise self.refused(node, "has a call in the middle", "give the call a line of its own")
        values = [self.number(nodes[0]), self.number(nodes[1]), *self.sometimes(self.number, nodes[2:])]
        signs = [COMPARISONS[type(op)] for op in node.ops]
        tests = [
            f"{low.within(SUM)} {sign} {high.within(SUM)}"
            for low, high, (sign, _) in zip(values, values[1:], signs, strict=False)
        ]
        return Value(BOOL, " && ".join(tests), signs[0][1] if len(tests) == 1 else AND)

    def sometimes(self, visit: Callable[[ast.expr], Value], nodes: Sequence[ast.expr]) -> list[Value]:
        """Expressions that are evaluated only sometimes."""
        self.lazy += 1
        values = [visit(node) for node in nodes]
        self.lazy -= 1
        return values

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:
        sign, level = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
        parts = [self.truth(node.values[0]), *self.sometimes(self.truth, node.values[1:])]
        return Value(BOOL, f" {sign} ".join(part.within(EQUALITY) for part in parts), level)

    def visit_IfExp(self, node: ast.IfExp) -> Value:
        test = self.truth(node.test)
        yes, no = self.sometimes(self.number, (node.body, node.orelse))
        if yes.kind != no.kind:
            raise self.refused(node, "has values of two kinds", "make both a float, or both an int")
        return Value(yes.kind, f"{test.within(OR)} ? {yes.within(OR)} : {no.within(CHOICE)}", CHOICE)

    # ---- calls

    def visit_Call(self, node: ast.Call) -> Value:
        clean = self.clean
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            raise self.refused(node, "has arguments by name", "give them by position")
        called = self.parent(node) or self.visit(node.func).kind
        values = [self.visit(argument) for argument in node.args]
        if isinstance(called, Method):
            return self.call(node, called.function, [Value(Object(called.cls), called.owner), *values], clean)
        if isinstance(called, Known) and isinstance(called.value, FunctionType):
            return self.call(node, called.value, values, clean)
        if isinstance(called, Known) and isinstance(called.value, (BuiltinFunctionType, type)):
            return self.built_in(node, called.value, values)
        raise self.refused(node, "calls what is no function", "call a function of the numerics or of math")

    def parent(self, node: ast.Call) -> Method | None:
        """The method that super().name stands for."""
        match node.func:
            case ast.Attribute(value=ast.Call(func=ast.Name(id="super"), args=[]), attr=name):
                kind = self.locals["self"]
                home = inspect.getclosurevars(self.function).nonlocals["__class__"]
                assert isinstance(kind, Object)
                lineage = kind.cls.__mro__
                for cls in lineage[lineage.index(home) + 1 :]:
                    if name in vars(cls):
                        return Method(vars(cls)[name], "self", kind.cls)
                raise self.refused(node, "has no such method above", "look for a slip of the pen")
        return None

    def call(self, node: ast.Call, function: FunctionType, values: list[Value], clean: bool) -> Value:
        """A call of a function of the numerics, specialised to the kinds of its arguments."""
        count = function.__code__.co_argcount
        if len(values) != count or function.__code__.co_kwonlyargcount or function.__defaults__:
            raise self.refused(node, f"gives {len(values)} arguments to a function of {count}", "give every argument")
        given = [
            self.at_run_time(node, value) if isinstance(value.kind, Known) and kind_of(value.kind.value) else value
            for value in values
        ]
        if not all(isinstance(value.kind, (Scalar, Object, Known)) for value in given):
            raise self.refused(node, "passes several numbers as one", "pass each, or the object that owns them")
        compiled = self.program.specialised(function, [value.kind for value in given])
        if compiled is None:
            raise self.refused(node, "calls a function that is still running", "write a loop")
        if self.faulty and not compiled.pure:  # a fault in the arguments keeps the call from having effects
            given = [self.kept(value) if isinstance(value.kind, Scalar) else value for value in given]
            self.check()
        texts = [value.text for value in given if not isinstance(value.kind, Known)]
        if compiled.faults:
            texts.append(self.fault())
        text = f"{compiled.name}({', '.join(texts)})"
        self.clean = False
        if not compiled.pure:
            self.pure = False
            if self.alone is not node:
                if self.lazy or not clean:
                    raise self.refused(
                        node, "has effects in the middle of an expression", "give the call a line of its own"
                    )
                if compiled.result:
                    text = self.temporary(compiled.result, text)
                    self.check()
                    self.clean = True
        return Value(compiled.result or Known(None), text)

    def built_in(self, node: ast.Call, function: Callable[..., Any], values: list[Value]) -> Value:
        """A function of math, or one of the few built-in ones."""
        allowed = (*TOTAL, *PARTIAL, *TESTS, abs, min, max, float)
        if function not in allowed:
            raise self.refused(node, "is no call of the subset", "use abs, min, max, float or one of C in math")
        if function in (min, max):
            if len(values) < 2:
                raise self.refused(node, "needs numbers to choose from", "give two or more")
        elif len(values) != ARGUMENTS.get(function, 1):
            raise self.refused(node, "has the wrong number of arguments", "look into the documentation of math")
        values = [self.arithmetic(argument, value) for argument, value in zip(node.args, values, strict=True)]
        texts = ", ".join(value.text for value in values)
        if function in (min, max, abs):
            if {value.kind for value in values} != {FLOAT}:
                raise self.refused(node, "takes floats only here", "write a conditional")
            name = {min: "lesser", max: "greater", abs: "fabs"}[function]
            text = values[0].text
            for value in values[1:]:
                text = f"{name}({text}, {value.text})"
            return Value(FLOAT, f"fabs({text})" if function is abs else text)
        if function is float:
            return Value(FLOAT, f"(double){values[0].within(WHOLE)}", SIGN)
        if function in TESTS:
            return Value(BOOL, f"{function.__name__}({texts}) != 0", EQUALITY)
        if function in TOTAL:
            return Value(FLOAT, f"{function.__name__}({texts})")
        return Value(FLOAT, f"py_{function.__name__}({texts}, {self.fault()})")


def group(values: Sequence[Value]) -> Value:
    """Several numbers together."""
    kind = Group(tuple(value.kind for value in values if isinstance(value.kind, Scalar)))
    return Value(kind, f"({kind.c}){{{', '.join(value.text for value in values)}}}")
