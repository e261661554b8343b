"""The derivative of a model along a direction: compute_outputs,
differentiated statement by statement (forward mode).

Every calculated number z gets a second one, _d_z, which is its change if states, driver and inputs change as told.  The
branches are those that `compute_outputs` takes; where friction sticks, its force is the load, and so are their changes.

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

# what the second number is called; the object that holds the direction and what follows: no name of an author's
PREFIX, TANGENT = "_d_", "_tangent"
ARGUMENT = Expression()


class Tangent:
    """A direction, and what follows along it: one float for each variable that has one."""


def tangent_fields(declared: Variables) -> dict[str, str]:
    """Of every variable that can change or follow: the name of its float."""
    found = {name: name for name, meaning in declared if "." not in name and has_tangent(meaning)}
    return found | {name: f"_rate_{number}" for number, (name, _) in enumerate(declared) if name.startswith("der(")}


def has_tangent(meaning: Any) -> bool:
    return meaning.type == "Real" and meaning.causality in ("input", "output")


def build_tangent_function(model: type[VariableOwner], thing: Any, declared: Variables) -> tuple[Tangent, FunctionType]:
    """Build the function propagate_tangent(self, _tangent) for `thing`, a model that can be used for model exchange,
    and an empty tangent to pass to it."""
    to = Tangent()
    for slot in tangent_fields(declared).values():
        setattr(to, slot, 0.0)
    observe: Any = model.__dict__["compute_outputs"]
    tree = function_tree(observe)
    writer = TangentWriter(thing, declared)
    known = {"t": "t"} | {name: scalar_name(thing, name) for name in (*thing.states, *thing.contacts)}
    begin = [f"{name} = self.solver.{number}" for name, number in known.items()]
    begin += [f"{PREFIX}{name} = {TANGENT}.{name}" for name in thing.states]
    body = [ast.parse(line).body[0] for line in begin] + writer.block(tree.body)
    text = ast.unparse(ast.fix_missing_locations(ast.Module([function_around(body)], [])))
    module = sys.modules[model.__module__]
    names = vars(math) | vars(module) | {threshold_tangent.__name__: threshold_tangent, TREE_NAME: ast.parse(text)}
    exec(compile(text, module.__file__ or "?", "exec"), names)
    return to, names["propagate_tangent"]


def function_around(body: list[ast.stmt]) -> ast.FunctionDef:
    """The function around the statements."""
    found = ast.parse(f'def propagate_tangent(self, {TANGENT}):\n    """What follows, along a direction."""').body[0]
    assert isinstance(found, ast.FunctionDef)
    found.body += body
    return found


class TangentWriter:
    """The statements of `compute_outputs`, each after that of its change."""

    def __init__(self, thing: Any, declared: Variables) -> None:
        inputs = [name for name, meaning in declared if meaning.causality == "input"]
        drivers = [name for name, meaning in declared if meaning.rate]
        self.seeds = {attribute: name for name in inputs for attribute in (name, f"{name}_polynomial")}
        self.seeds |= dict(zip(["x_base"] * len(drivers), drivers, strict=True))
        self.outputs = {name for name, meaning in declared if has_tangent(meaning)}
        self.floats = set(thing.states)  # local names that have a change
        self.counts = set(thing.contacts)  # and those that have none

    def block(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """They share with those of `compute_outputs` what stays."""
        found: list[ast.stmt] = []
        for node in statements:
            match node:
                case ast.Assign(targets=[ast.Name(id=name)], value=value) if name not in self.counts:
                    found += [self.assignment(f"{PREFIX}{name}", self.tangent_of(value)), node]
                    self.floats.add(name)
                case ast.Assign(targets=[ast.Name()]):
                    found.append(node)
                case ast.Assign(targets=[ast.Attribute(attr=name)], value=value) if name in self.outputs:
                    found.append(self.assignment(f"{TANGENT}.{name}", self.tangent_of(value)))
                case ast.If():
                    found.append(ast.If(node.test, self.block(node.body), self.block(node.orelse)))
        return found

    @staticmethod
    def assignment(target: str, tangent_of: ast.expr | None) -> ast.stmt:
        return ast.parse(f"{target} = {source_of(tangent_of)}").body[0]

    def tangent_of(self, e: ast.expr) -> ast.expr | None:
        """How an expression changes; None where it does not."""
        match e:
            case ast.Name(id=name) if name in self.floats:
                return ast.Name(PREFIX + name)
            case ast.Attribute(attr=name) if name in self.seeds:
                return ast.parse(f"{TANGENT}.{self.seeds[name]}", mode="eval").body
            case ast.Call(func=ast.Attribute(value=course)):
                return self.tangent_of(course)
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return negate_term(self.tangent_of(inner))
            case ast.BinOp(left=a, op=op, right=b):
                return self.binary_tangent(e, a, op, b)
            case ast.IfExp(test=test, body=yes, orelse=no):
                ways = self.tangent_of(yes), self.tangent_of(no)
                return (
                    None
                    if ways == (None, None)
                    else parse_expression(f"{source_of(ways[0])} if {source_of(test)} else {source_of(ways[1])}")
                )
            case ast.Call(func=ast.Name(id="threshold"), args=[v, eps, load, slide, hold]):
                changes = [source_of(self.tangent_of(one)) for one in (load, slide, hold)]
                return parse_expression(
                    f"threshold_tangent({', '.join(map(source_of, (v, eps, load, hold)))}, {', '.join(changes)})"
                )
            case ast.Call(func=ast.Name(id=name), args=[a]) if name in FUNCTIONS:
                return multiply_terms(parse_expression(derivative_factor(name, source_of(a))), self.tangent_of(a))
        return None

    def binary_tangent(self, e: ast.expr, a: ast.expr, op: ast.operator, b: ast.expr) -> ast.expr | None:
        da, db = self.tangent_of(a), self.tangent_of(b)
        match op:
            case ast.Add():
                return add_terms(da, db)
            case ast.Sub():
                return add_terms(da, negate_term(db))
            case ast.Mult():
                return add_terms(multiply_terms(a, db), multiply_terms(b, da))
        first = None if da is None else parse_expression(f"({source_of(da)}) / ({source_of(b)})")
        return add_terms(
            first, None if db is None else parse_expression(f"-({source_of(e)}) * ({source_of(db)}) / ({source_of(b)})")
        )


def derivative_factor(name: str, a: str) -> str:
    """The factor of the change of a in that of a function of a."""
    if name == "sqrt":
        return f"0.5 / sqrt({a})"  # not as the equations have it, where it is zero at zero
    return ExpressionPrinter({ARGUMENT: a}, (), (), 0).text(FUNCTIONS[name](ARGUMENT, Term(name, ARGUMENT)))


def threshold_tangent(v, eps, load, hold, d_load, d_slide, d_hold):  # type: ignore[no-untyped-def] # it is translated
    """The change of friction by the threshold law."""
    if fabs(v) >= eps:
        return d_slide if v > 0.0 else -d_slide
    return d_hold if load > hold else -d_hold if load < -hold else d_load


def parse_expression(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def source_of(e: ast.expr | None) -> str:
    return "0.0" if e is None else ast.unparse(e)


def add_terms(a: ast.expr | None, b: ast.expr | None) -> ast.expr | None:
    return b if a is None else a if b is None else ast.BinOp(a, ast.Add(), b)


def multiply_terms(a: ast.expr, b: ast.expr | None) -> ast.expr | None:
    return None if b is None else ast.BinOp(a, ast.Mult(), b)


def negate_term(e: ast.expr | None) -> ast.expr | None:
    return None if e is None else ast.UnaryOp(ast.USub(), e)
