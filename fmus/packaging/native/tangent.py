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
D, TO = "_d_", "_to"
ARGUMENT = Expression()


class Tangent:
    """A direction, and what follows along it: one float for each variable that has one."""


def slots(declared: Variables) -> dict[str, str]:
    """Of every variable that can change or follow: the name of its float."""
    found = {name: name for name, meaning in declared if "." not in name and is_smooth(meaning)}
    return found | {name: f"_rate_{number}" for number, (name, _) in enumerate(declared) if name.startswith("der(")}


def is_smooth(meaning: Any) -> bool:
    return meaning.type == "Real" and meaning.causality in ("input", "output")


def tangent(model: type[VariableOwner], thing: Any, declared: Variables) -> tuple[Tangent, FunctionType]:
    """An empty direction, and the function that follows it: along(self, _to), where self is `thing`, a model that an
    importer's solver may lead."""
    to = Tangent()
    for slot in slots(declared).values():
        setattr(to, slot, 0.0)
    observe: Any = model.__dict__["compute_outputs"]
    tree = function_tree(observe)
    writer = Writer(thing, declared)
    known = {"t": "t"} | {name: scalar_name(thing, name) for name in (*thing.states, *thing.contacts)}
    begin = [f"{name} = self.solver.{number}" for name, number in known.items()]
    begin += [f"{D}{name} = {TO}.{name}" for name in thing.states]
    body = [ast.parse(line).body[0] for line in begin] + writer.block(tree.body)
    text = ast.unparse(ast.fix_missing_locations(ast.Module([head(body)], [])))
    module = sys.modules[model.__module__]
    names = vars(math) | vars(module) | {threshold_slope.__name__: threshold_slope, TREE_NAME: ast.parse(text)}
    exec(compile(text, module.__file__ or "?", "exec"), names)
    return to, names["along"]


def head(body: list[ast.stmt]) -> ast.FunctionDef:
    """The function around the statements."""
    found = ast.parse(f'def along(self, {TO}):\n    """What follows, along a direction."""').body[0]
    assert isinstance(found, ast.FunctionDef)
    found.body += body
    return found


class Writer:
    """The statements of `compute_outputs`, each after that of its change."""

    def __init__(self, thing: Any, declared: Variables) -> None:
        inputs = [name for name, meaning in declared if meaning.causality == "input"]
        drivers = [name for name, meaning in declared if meaning.rate]
        self.seeds = {attribute: name for name in inputs for attribute in (name, f"{name}_polynomial")}
        self.seeds |= dict(zip(["x_base"] * len(drivers), drivers, strict=True))
        self.outputs = {name for name, meaning in declared if is_smooth(meaning)}
        self.floats = set(thing.states)  # local names that have a change
        self.counts = set(thing.contacts)  # and those that have none

    def block(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """They share with those of `compute_outputs` what stays."""
        found: list[ast.stmt] = []
        for node in statements:
            match node:
                case ast.Assign(targets=[ast.Name(id=name)], value=value) if name not in self.counts:
                    found += [self.let(f"{D}{name}", self.change(value)), node]
                    self.floats.add(name)
                case ast.Assign(targets=[ast.Name()]):
                    found.append(node)
                case ast.Assign(targets=[ast.Attribute(attr=name)], value=value) if name in self.outputs:
                    found.append(self.let(f"{TO}.{name}", self.change(value)))
                case ast.If():
                    found.append(ast.If(node.test, self.block(node.body), self.block(node.orelse)))
        return found

    @staticmethod
    def let(target: str, change: ast.expr | None) -> ast.stmt:
        return ast.parse(f"{target} = {told(change)}").body[0]

    def change(self, e: ast.expr) -> ast.expr | None:
        """How an expression changes; None where it does not."""
        match e:
            case ast.Name(id=name) if name in self.floats:
                return ast.Name(D + name)
            case ast.Attribute(attr=name) if name in self.seeds:
                return ast.parse(f"{TO}.{self.seeds[name]}", mode="eval").body
            case ast.Call(func=ast.Attribute(value=course)):
                return self.change(course)
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return negative(self.change(inner))
            case ast.BinOp(left=a, op=op, right=b):
                return self.of_two(e, a, op, b)
            case ast.IfExp(test=test, body=yes, orelse=no):
                ways = self.change(yes), self.change(no)
                return None if ways == (None, None) else read(f"{told(ways[0])} if {told(test)} else {told(ways[1])}")
            case ast.Call(func=ast.Name(id="threshold"), args=[v, eps, load, slide, hold]):
                changes = [told(self.change(one)) for one in (load, slide, hold)]
                return read(f"threshold_slope({', '.join(map(told, (v, eps, load, hold)))}, {', '.join(changes)})")
            case ast.Call(func=ast.Name(id=name), args=[a]) if name in FUNCTIONS:
                return times(read(slope(name, told(a))), self.change(a))
        return None

    def of_two(self, e: ast.expr, a: ast.expr, op: ast.operator, b: ast.expr) -> ast.expr | None:
        da, db = self.change(a), self.change(b)
        match op:
            case ast.Add():
                return plus(da, db)
            case ast.Sub():
                return plus(da, negative(db))
            case ast.Mult():
                return plus(times(a, db), times(b, da))
        first = None if da is None else read(f"({told(da)}) / ({told(b)})")
        return plus(first, None if db is None else read(f"-({told(e)}) * ({told(db)}) / ({told(b)})"))


def slope(name: str, a: str) -> str:
    """The factor of the change of a in that of a function of a."""
    if name == "sqrt":
        return f"0.5 / sqrt({a})"  # not as the equations have it, where it is zero at zero
    return ExpressionPrinter({ARGUMENT: a}, (), (), 0).text(FUNCTIONS[name](ARGUMENT, Term(name, ARGUMENT)))


def threshold_slope(v, eps, load, hold, d_load, d_slide, d_hold):  # type: ignore[no-untyped-def] # it is translated
    """The change of friction by the threshold law."""
    if fabs(v) >= eps:
        return d_slide if v > 0.0 else -d_slide
    return d_hold if load > hold else -d_hold if load < -hold else d_load


def read(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def told(e: ast.expr | None) -> str:
    return "0.0" if e is None else ast.unparse(e)


def plus(a: ast.expr | None, b: ast.expr | None) -> ast.expr | None:
    return b if a is None else a if b is None else ast.BinOp(a, ast.Add(), b)


def times(a: ast.expr, b: ast.expr | None) -> ast.expr | None:
    return None if b is None else ast.BinOp(a, ast.Mult(), b)


def negative(e: ast.expr | None) -> ast.expr | None:
    return None if e is None else ast.UnaryOp(ast.USub(), e)
