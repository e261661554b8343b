"""Directional derivatives: differentiates a model's `compute_outputs` statement by statement (forward mode).

For every calculated number z the generated function calculates its tangent _d_z, the change of z when states, driver
and inputs change in a given direction. It takes the same branches as `compute_outputs`. Where friction sticks, the
force equals the load, and their tangents are equal as well.

References
----------
A. Griewank, A. Walther, Evaluating Derivatives, chapter 3.
"""

import ast
import math
import sys
from math import fabs
from types import FunctionType
from typing import Any

from ...runtime.variable_declarations import VariableOwner
from ..equations.expression_printer import ExpressionPrinter
from ..equations.expressions import FUNCTIONS, Expression, Term
from ..fmi_variables import Variables
from ..lowering import function_tree
from ..lowering.import_hook import TREE_NAME, scalar_name

# Prefix of tangents, and the parameter that holds the direction and the results. No variable of a model starts with _.
PREFIX, TANGENT = "_d_", "_tangent"
ARGUMENT = Expression()


class Tangent:
    """A direction and the resulting changes: one float per variable with a tangent."""


def tangent_fields(declared: Variables) -> dict[str, str]:
    """Return the attribute of Tangent for each variable that has one."""
    fields = {name: name for name, meaning in declared if "." not in name and has_tangent(meaning)}
    return fields | {name: f"_rate_{number}" for number, (name, _) in enumerate(declared) if name.startswith("der(")}


def has_tangent(meaning: Any) -> bool:
    """Check whether a declared variable has a derivative: a Real input or output."""
    return meaning.type == "Real" and meaning.causality in ("input", "output")


def build_tangent_function(
    model: type[VariableOwner], instance: Any, declared: Variables
) -> tuple[Tangent, FunctionType]:
    """Build the function propagate_tangent(self, _tangent), and an empty Tangent to pass to it.

    `instance` is an object of the model for model exchange.
    """
    tangent = Tangent()
    for field in tangent_fields(declared).values():
        setattr(tangent, field, 0.0)
    observe: Any = model.__dict__["compute_outputs"]
    tree = function_tree(observe)
    writer = TangentWriter(instance, declared)
    known = {"t": "t"} | {name: scalar_name(instance, name) for name in (*instance.states, *instance.contacts)}
    begin = [f"{name} = self.solver.{number}" for name, number in known.items()]
    begin += [f"{PREFIX}{name} = {TANGENT}.{name}" for name in instance.states]
    body = [ast.parse(line).body[0] for line in begin] + writer.differentiate(tree.body)
    text = ast.unparse(ast.fix_missing_locations(ast.Module([function_around(body)], [])))
    module = sys.modules[model.__module__]
    names = vars(math) | vars(module) | {threshold_tangent.__name__: threshold_tangent, TREE_NAME: ast.parse(text)}
    exec(compile(text, module.__file__ or "?", "exec", optimize=0), names)
    return tangent, names["propagate_tangent"]


def function_around(body: list[ast.stmt]) -> ast.FunctionDef:
    """Wrap statements in the function."""
    function = ast.parse(
        f'def propagate_tangent(self, {TANGENT}):\n    """Calculate the directional derivative."""'
    ).body[0]
    assert isinstance(function, ast.FunctionDef)
    function.body += body
    return function


class TangentWriter:
    """Differentiates the statements of `compute_outputs`; each derivative comes before its statement."""

    def __init__(self, instance: Any, declared: Variables) -> None:
        inputs = [name for name, meaning in declared if meaning.causality == "input"]
        drivers = [name for name, meaning in declared if meaning.rate]
        self.seeds = {attribute: name for name in inputs for attribute in (name, f"{name}_polynomial")}
        self.seeds |= dict(zip(["x_base"] * len(drivers), drivers, strict=True))
        self.outputs = {name for name, meaning in declared if has_tangent(meaning)}
        self.with_tangent = set(instance.states)  # local variables with a tangent
        self.without_tangent = set(instance.contacts)  # local variables without one

    def differentiate(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """Return statements and their derivatives."""
        result: list[ast.stmt] = []
        for node in statements:
            match node:
                case ast.Assign(targets=[ast.Name(id=name)], value=value) if name not in self.without_tangent:
                    result += [self.assignment(f"{PREFIX}{name}", self.tangent_of(value)), node]
                    self.with_tangent.add(name)
                case ast.Assign(targets=[ast.Name()]):
                    result.append(node)
                case ast.Assign(targets=[ast.Attribute(attr=name)], value=value) if name in self.outputs:
                    result.append(self.assignment(f"{TANGENT}.{name}", self.tangent_of(value)))
                case ast.If():
                    result.append(ast.If(node.test, self.differentiate(node.body), self.differentiate(node.orelse)))
        return result

    @staticmethod
    def assignment(target: str, value: ast.expr | None) -> ast.stmt:
        """Return the statement target = value."""
        return ast.parse(f"{target} = {source_of(value)}").body[0]

    def tangent_of(self, e: ast.expr) -> ast.expr | None:
        """Return the tangent of an expression; None if it is zero."""
        match e:
            case ast.Name(id=name) if name in self.with_tangent:
                return ast.Name(PREFIX + name)
            case ast.Attribute(attr=name) if name in self.seeds:
                return ast.parse(f"{TANGENT}.{self.seeds[name]}", mode="eval").body
            case ast.Call(func=ast.Attribute(value=polynomial)):
                return self.tangent_of(polynomial)
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return negate_term(self.tangent_of(inner))
            case ast.BinOp(left=a, op=op, right=b):
                return self.binary_tangent(e, a, op, b)
            case ast.IfExp(test=test, body=yes, orelse=no):
                branches = self.tangent_of(yes), self.tangent_of(no)
                if branches == (None, None):
                    return None
                return parse_expression(f"{source_of(branches[0])} if {source_of(test)} else {source_of(branches[1])}")
            case ast.Call(func=ast.Name(id="threshold"), args=[v, eps, load, slide, hold]):
                changes = [source_of(self.tangent_of(e)) for e in (load, slide, hold)]
                return parse_expression(
                    f"threshold_tangent({', '.join(map(source_of, (v, eps, load, hold)))}, {', '.join(changes)})"
                )
            case ast.Call(func=ast.Name(id=name), args=[a]) if name in FUNCTIONS:
                return multiply_terms(parse_expression(derivative_factor(name, source_of(a))), self.tangent_of(a))
        return None

    def binary_tangent(self, e: ast.expr, a: ast.expr, op: ast.operator, b: ast.expr) -> ast.expr | None:
        """Return the tangent of a sum, difference, product or quotient."""
        da, db = self.tangent_of(a), self.tangent_of(b)
        match op:
            case ast.Add():
                return add_terms(da, db)
            case ast.Sub():
                return add_terms(da, negate_term(db))
            case ast.Mult():
                return add_terms(multiply_terms(a, db), multiply_terms(b, da))
        from_a = None if da is None else parse_expression(f"({source_of(da)}) / ({source_of(b)})")
        from_b = None if db is None else parse_expression(f"-({source_of(e)}) * ({source_of(db)}) / ({source_of(b)})")
        return add_terms(from_a, from_b)


def derivative_factor(name: str, a: str) -> str:
    """Return the derivative of a function with respect to its argument, as text."""
    if name == "sqrt":
        return f"0.5 / sqrt({a})"  # the equations define it as zero at zero; here it faults
    return ExpressionPrinter({ARGUMENT: a}, (), (), 0).text(FUNCTIONS[name](ARGUMENT, Term(name, ARGUMENT)))


def threshold_tangent(v, eps, load, hold, d_load, d_slide, d_hold):  # type: ignore[no-untyped-def] # translated to C
    """Tangent of the friction force of the threshold law."""
    if fabs(v) >= eps:
        return d_slide if v > 0.0 else -d_slide
    return d_hold if load > hold else -d_hold if load < -hold else d_load


def parse_expression(text: str) -> ast.expr:
    """Parse the text of an expression."""
    return ast.parse(text, mode="eval").body


def source_of(e: ast.expr | None) -> str:
    """Return the text of an expression; None is zero."""
    return "0.0" if e is None else ast.unparse(e)


def add_terms(a: ast.expr | None, b: ast.expr | None) -> ast.expr | None:
    """Return a + b; None is zero."""
    return b if a is None else a if b is None else ast.BinOp(a, ast.Add(), b)


def multiply_terms(a: ast.expr, b: ast.expr | None) -> ast.expr | None:
    """Return a * b; None is zero."""
    return None if b is None else ast.BinOp(a, ast.Mult(), b)


def negate_term(e: ast.expr | None) -> ast.expr | None:
    """Return -e; None is zero."""
    return None if e is None else ast.UnaryOp(ast.USub(), e)
