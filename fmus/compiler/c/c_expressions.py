"""Translates a Python expression of the numerics to C and infers its type.

Constant subexpressions are evaluated here, by Python. A call with side effects moves to a line of its own before the
statement; if that changed the order of evaluation, the translation fails.
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
from typing import Any, NoReturn

from ..syntax_trees import TranslationError
from .c_types import (
    BOOL,
    FLOAT,
    INT,
    BoundMethod,
    CFunction,
    CompileTimeValue,
    CType,
    FloatArray,
    Scalar,
    ScalarTuple,
    StructPointer,
    c_declaration,
    c_literal,
    scalar_type_of,
    source_location,
)
from .struct_layout import StructLayout

# Translates a function for given types of its arguments; None means that it is recursive.
Specialise = Callable[[FunctionType, list[CType]], CFunction | None]

# Operator precedence of C, lowest first. For arithmetic, Python's is the same.
CONDITIONAL, OR, AND, EQUALITY, RELATIONAL, ADDITIVE, MULTIPLICATIVE, UNARY, PRIMARY = range(9)

NEVER_RAISING = (math.fabs, math.copysign, math.atan, math.atan2, math.tanh)  # functions that raise no exception
MAY_RAISE = (
    *(math.sqrt, math.sin, math.cos, math.tan, math.asin, math.acos, math.sinh, math.cosh),
    *(math.exp, math.expm1, math.log, math.log1p, math.pow, math.fmod),
)
PREDICATES = (math.isfinite, math.isnan, math.isinf)
ARGUMENT_COUNTS = {math.copysign: 2, math.atan2: 2, math.pow: 2, math.fmod: 2}

ARITHMETIC = {ast.Add: ("+", ADDITIVE), ast.Sub: ("-", ADDITIVE), ast.Mult: ("*", MULTIPLICATIVE)}
FOLDABLE: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
COMPARISONS: dict[type, tuple[str, int]] = {
    **{ast.Lt: ("<", RELATIONAL), ast.LtE: ("<=", RELATIONAL), ast.Gt: (">", RELATIONAL), ast.GtE: (">=", RELATIONAL)},
    **{ast.Eq: ("==", EQUALITY), ast.NotEq: ("!=", EQUALITY)},
}

FAULT_CHECK = "if (*fault) {leave}"
# Literals and local constants: evaluating them later gives the same value.
STABLE_TEXT = re.compile(r"-?\d[\w.+-]*|INFINITY|MINUS_INFINITY|NAN|true|false|_\d+")


@dataclass(frozen=True)
class CExpression:
    """An expression: its type, its C text and the precedence of its outermost operator."""

    ctype: CType
    text: str = ""
    precedence: int = PRIMARY

    def as_operand(self, precedence: int) -> str:
        """Return the text, in parentheses if it is an operand of an operator of higher precedence."""
        return self.text if self.precedence >= precedence else f"({self.text})"


class ExpressionTranslator(ast.NodeVisitor):
    """Translator for the expressions of one function."""

    def __init__(self, layout: StructLayout, specialise: Specialise, function: FunctionType) -> None:
        self.layout, self.specialise, self.function = layout, specialise, function
        self.local_types: dict[str, CType] = {}
        self.assigned_names: set[str] = set()  # names that are assigned on every path to this statement
        self.lines: list[str] = []
        self.depth = 1
        self.temporaries = count(1)
        self.is_pure = True
        self.can_fault = False  # anywhere in the function
        # State of the current statement:
        self.may_fault = False  # part of it can fault, and no check has been emitted since
        self.effects_allowed = True  # nothing evaluated so far can be changed by a call, or fault
        self.conditional_depth = 0  # nesting depth of operands that are evaluated conditionally
        self.statement_call: ast.AST | None = None  # a call that is the whole right-hand side

    def error(self, node: ast.AST) -> TranslationError:
        """Return the error for a node of this function."""
        return TranslationError(source_location(self.function, getattr(node, "lineno", 0)), node)

    def generic_visit(self, node: ast.AST) -> NoReturn:
        raise self.error(node)

    def fault_argument(self) -> str:
        """Return the argument for the fault flag, and note that the statement can fault."""
        self.may_fault = self.can_fault = True
        self.effects_allowed = False
        return "fault"

    # ---- lines

    def emit(self, line: str) -> None:
        self.lines.append("    " * self.depth + line)

    def emit_temporary(self, ctype: CType, text: str) -> str:
        """Store a value in a new local constant."""
        name = f"_{next(self.temporaries)}"
        self.emit(f"const {c_declaration(ctype, name)} = {text};")
        return name

    def in_local(self, value: CExpression) -> CExpression:
        """Store a value in a local, unless it is a literal or a local already."""
        if STABLE_TEXT.fullmatch(value.text):
            return value
        return CExpression(value.ctype, self.emit_temporary(value.ctype, value.text))

    def emit_fault_check(self) -> None:
        """Return from the function if the previous line has set the fault flag."""
        if self.may_fault:
            self.emit(FAULT_CHECK)
        self.may_fault = False

    # ---- numbers and conditions

    def run_time_number(self, node: ast.expr) -> CExpression:
        """Translate an expression that must be a number."""
        return self.to_run_time(node, self.visit(node))

    def to_run_time(self, node: ast.AST, value: CExpression) -> CExpression:
        ctype = value.ctype
        if isinstance(ctype, CompileTimeValue) and (scalar := scalar_type_of(ctype.value)):
            text = c_literal(ctype.value)
            return CExpression(scalar, text, UNARY if text.startswith("-") else PRIMARY)
        if not isinstance(ctype, Scalar):
            raise self.error(node)
        return value

    def arithmetic_operand(self, node: ast.expr, value: CExpression) -> CExpression:
        value = self.to_run_time(node, value)
        if value.ctype is BOOL:
            raise self.error(node)
        return value

    def boolean(self, node: ast.expr) -> CExpression:
        """Translate an expression that must be a bool. Conditions on model constants were folded before."""
        value = self.run_time_number(node)
        if value.ctype is not BOOL:
            raise self.error(node)
        return value

    # ---- names

    def visit_Constant(self, node: ast.Constant) -> CExpression:
        return CExpression(CompileTimeValue(node.value))

    def visit_Name(self, node: ast.Name) -> CExpression:
        if node.id in self.local_types:
            if node.id not in self.assigned_names:
                raise self.error(node)
            return CExpression(self.local_types[node.id], node.id)
        for names in (self.function.__globals__, vars(builtins)):
            if node.id in names:
                return CExpression(CompileTimeValue(names[node.id]))
        raise self.error(node)

    def visit_Attribute(self, node: ast.Attribute) -> CExpression:
        owner = self.visit(node.value)
        if isinstance(owner.ctype, CompileTimeValue):
            if not hasattr(owner.ctype.value, node.attr):
                raise self.error(node)
            return CExpression(CompileTimeValue(getattr(owner.ctype.value, node.attr)))
        if not isinstance(owner.ctype, StructPointer):
            raise self.error(node)
        cls = owner.ctype.cls
        lvalue = f"{owner.text[1:]}.{node.attr}" if owner.text.startswith("&") else f"{owner.text}->{node.attr}"
        field = self.layout.fields[cls].get(node.attr)
        if isinstance(field, StructPointer):
            return CExpression(field, "&" + lvalue, UNARY)
        if field:
            self.effects_allowed = False
            return CExpression(field, lvalue)
        attribute = inspect.getattr_static(cls, node.attr, None)
        if isinstance(attribute, FunctionType):
            return CExpression(BoundMethod(attribute, owner.text, cls))
        if scalar_type_of(attribute):
            return CExpression(CompileTimeValue(attribute))
        raise self.error(node)

    def visit_Subscript(self, node: ast.Subscript) -> CExpression:
        row, index = self.visit(node.value), self.visit(node.slice)
        if isinstance(row.ctype, CompileTimeValue) and isinstance(node.value, ast.Name):
            row = self.constant_array(node.value.id, row)
        if not isinstance(row.ctype, FloatArray):
            raise self.error(node)
        if isinstance(index.ctype, CompileTimeValue):
            if not (isinstance(index.ctype.value, int) and -row.ctype.length <= index.ctype.value < row.ctype.length):
                raise self.error(node)
            return CExpression(FLOAT, f"{row.text}[{index.ctype.value % row.ctype.length}]")
        if index.ctype is not INT:
            raise self.error(node)
        index_text = f"py_index({index.text}, {row.ctype.length}, {self.fault_argument()})"
        if not self.conditional_depth:
            index_text = self.emit_temporary(INT, index_text)
            self.emit_fault_check()
        return CExpression(FLOAT, f"{row.text}[{index_text}]")

    def constant_array(self, name: str, row: CExpression) -> CExpression:
        """Return the static array for a tuple of floats of the module; other values unchanged."""
        values = row.ctype.value if isinstance(row.ctype, CompileTimeValue) else None
        if not (isinstance(values, tuple) and values and all(scalar_type_of(value) is FLOAT for value in values)):
            return row
        self.layout.constant_arrays[name] = values
        return CExpression(FloatArray(len(values)), f"table{name}")

    # ---- operators

    def visit_UnaryOp(self, node: ast.UnaryOp) -> CExpression:
        if isinstance(node.op, ast.Not):
            return CExpression(BOOL, "!" + self.boolean(node.operand).as_operand(PRIMARY), UNARY)
        value = self.visit(node.operand)
        if isinstance(value.ctype, CompileTimeValue) and scalar_type_of(value.ctype.value) in (FLOAT, INT):
            number: Any = value.ctype.value
            return CExpression(CompileTimeValue(-number if isinstance(node.op, ast.USub) else number))
        if not isinstance(node.op, ast.USub):
            raise self.error(node)
        return CExpression(self.arithmetic_operand(node.operand, value).ctype, "-" + value.as_operand(PRIMARY), UNARY)

    def visit_BinOp(self, node: ast.BinOp) -> CExpression:
        left, right = self.visit(node.left), self.visit(node.right)
        operation = type(node.op)
        if (
            isinstance(left.ctype, CompileTimeValue)
            and isinstance(right.ctype, CompileTimeValue)
            and operation in FOLDABLE
        ):
            return CExpression(
                CompileTimeValue(self.fold(node, FOLDABLE[operation], left.ctype.value, right.ctype.value))
            )
        divisor = right.ctype.value if isinstance(right.ctype, CompileTimeValue) else 0.0
        left, right = self.arithmetic_operand(node.left, left), self.arithmetic_operand(node.right, right)
        ctype = FLOAT if FLOAT in (left.ctype, right.ctype) else INT
        if operation in ARITHMETIC:
            sign, precedence = ARITHMETIC[operation]
            return CExpression(
                ctype, f"{left.as_operand(precedence)} {sign} {right.as_operand(precedence + 1)}", precedence
            )
        if ctype is INT:
            raise self.error(node)
        if operation is ast.Div and divisor:
            return CExpression(FLOAT, f"{left.as_operand(MULTIPLICATIVE)} / {right.as_operand(UNARY)}", MULTIPLICATIVE)
        if operation is ast.Div:
            return CExpression(FLOAT, f"py_divide({left.text}, {right.text}, {self.fault_argument()})")
        if operation is ast.Pow:
            return CExpression(FLOAT, f"py_pow({left.text}, {right.text}, {self.fault_argument()})")
        raise self.error(node)

    def fold(self, node: ast.AST, function: Callable[..., Any], *values: object) -> object:
        """Evaluate an operation on constants in Python."""
        if not all(scalar_type_of(value) for value in values):
            raise self.error(node)
        try:
            return function(*values)
        except (ArithmeticError, ValueError) as error:
            raise self.error(node) from error

    def visit_Compare(self, node: ast.Compare) -> CExpression:
        nodes = [node.left, *node.comparators]
        if any(type(op) not in COMPARISONS for op in node.ops):
            raise self.error(node)
        for middle in nodes[1:-1]:
            if any(isinstance(part, ast.Call) for part in ast.walk(middle)):
                raise self.error(node)
        values = [
            self.run_time_number(nodes[0]),
            self.run_time_number(nodes[1]),
            *self.visit_conditional(self.run_time_number, nodes[2:]),
        ]
        signs = [COMPARISONS[type(op)] for op in node.ops]
        tests = [
            f"{low.as_operand(ADDITIVE)} {sign} {high.as_operand(ADDITIVE)}"
            for low, high, (sign, _) in zip(values, values[1:], signs, strict=False)
        ]
        return CExpression(BOOL, " && ".join(tests), signs[0][1] if len(tests) == 1 else AND)

    def visit_conditional(
        self, visit: Callable[[ast.expr], CExpression], nodes: Sequence[ast.expr]
    ) -> list[CExpression]:
        """Translate operands that are evaluated conditionally."""
        self.conditional_depth += 1
        values = [visit(node) for node in nodes]
        self.conditional_depth -= 1
        return values

    def visit_BoolOp(self, node: ast.BoolOp) -> CExpression:
        sign, precedence = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
        parts = [self.boolean(node.values[0]), *self.visit_conditional(self.boolean, node.values[1:])]
        return CExpression(BOOL, f" {sign} ".join(part.as_operand(EQUALITY) for part in parts), precedence)

    def visit_IfExp(self, node: ast.IfExp) -> CExpression:
        test = self.boolean(node.test)
        true_value, false_value = self.visit_conditional(self.run_time_number, (node.body, node.orelse))
        if true_value.ctype != false_value.ctype:
            raise self.error(node)
        return CExpression(
            true_value.ctype,
            f"{test.as_operand(OR)} ? {true_value.as_operand(OR)} : {false_value.as_operand(CONDITIONAL)}",
            CONDITIONAL,
        )

    # ---- calls

    def visit_Call(self, node: ast.Call) -> CExpression:
        effects_allowed = self.effects_allowed
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            raise self.error(node)
        callee = self.super_method(node) or self.visit(node.func).ctype
        values = [self.visit(argument) for argument in node.args]
        if isinstance(callee, BoundMethod):
            return self.translate_call(
                node, callee.function, [CExpression(StructPointer(callee.cls), callee.owner), *values], effects_allowed
            )
        if isinstance(callee, CompileTimeValue) and isinstance(callee.value, FunctionType):
            return self.translate_call(node, callee.value, values, effects_allowed)
        if isinstance(callee, CompileTimeValue) and isinstance(callee.value, (BuiltinFunctionType, type)):
            return self.translate_builtin(node, callee.value, values)
        raise self.error(node)

    def super_method(self, node: ast.Call) -> BoundMethod | None:
        """Find the method that super().name refers to."""
        match node.func:
            case ast.Attribute(value=ast.Call(func=ast.Name(id="super"), args=[]), attr=name):
                ctype = self.local_types["self"]
                home = inspect.getclosurevars(self.function).nonlocals["__class__"]
                assert isinstance(ctype, StructPointer)
                lineage = ctype.cls.__mro__
                for cls in lineage[lineage.index(home) + 1 :]:
                    if name in vars(cls):
                        return BoundMethod(vars(cls)[name], "self", ctype.cls)
                raise self.error(node)
        return None

    def translate_call(
        self, node: ast.Call, function: FunctionType, values: list[CExpression], effects_allowed: bool
    ) -> CExpression:
        """Translate a call of a function of the numerics, specialised to the types of its arguments."""
        if len(values) != function.__code__.co_argcount or function.__code__.co_kwonlyargcount or function.__defaults__:
            raise self.error(node)
        arguments = [
            self.to_run_time(node, value)
            if isinstance(value.ctype, CompileTimeValue) and scalar_type_of(value.ctype.value)
            else value
            for value in values
        ]
        if not all(isinstance(value.ctype, (Scalar, StructPointer, CompileTimeValue)) for value in arguments):
            raise self.error(node)
        c_function = self.specialise(function, [value.ctype for value in arguments])
        if c_function is None:
            raise self.error(node)
        if self.may_fault and not c_function.is_pure:  # after a fault in the arguments, the call must not have effects
            arguments = [self.in_local(value) if isinstance(value.ctype, Scalar) else value for value in arguments]
            self.emit_fault_check()
        texts = [value.text for value in arguments if not isinstance(value.ctype, CompileTimeValue)]
        if c_function.can_fault:
            texts.append(self.fault_argument())
        text = f"{c_function.name}({', '.join(texts)})"
        self.effects_allowed = False
        if not c_function.is_pure:
            self.is_pure = False
            if self.statement_call is not node:
                if self.conditional_depth or not effects_allowed:
                    raise self.error(node)
                if c_function.result:
                    text = self.emit_temporary(c_function.result, text)
                    self.emit_fault_check()
                    self.effects_allowed = True
        return CExpression(c_function.result or CompileTimeValue(None), text)

    def translate_builtin(self, node: ast.Call, function: Callable[..., Any], values: list[CExpression]) -> CExpression:
        """Translate a call of a function of math, of float or of int."""
        supported_functions = (*NEVER_RAISING, *MAY_RAISE, *PREDICATES, float, int)
        if function not in supported_functions or len(values) != ARGUMENT_COUNTS.get(function, 1):
            raise self.error(node)
        values = [self.arithmetic_operand(argument, value) for argument, value in zip(node.args, values, strict=True)]
        texts = ", ".join(value.text for value in values)
        if function is float:
            return CExpression(FLOAT, f"(double){values[0].as_operand(PRIMARY)}", UNARY)
        if function is int:  # of whole numbers
            return CExpression(INT, f"(int64_t){values[0].as_operand(PRIMARY)}", UNARY)
        if function in PREDICATES:
            return CExpression(BOOL, f"{function.__name__}({texts}) != 0", EQUALITY)
        if function in NEVER_RAISING:
            return CExpression(FLOAT, f"{function.__name__}({texts})")
        return CExpression(FLOAT, f"py_{function.__name__}({texts}, {self.fault_argument()})")


def make_tuple(values: Sequence[CExpression]) -> CExpression:
    """Combine several numbers in a struct."""
    ctype = ScalarTuple(tuple(value.ctype for value in values if isinstance(value.ctype, Scalar)))
    return CExpression(ctype, f"({ctype.c}){{{', '.join(value.text for value in values)}}}")
