"""Directional derivatives: differentiates three functions of a model statement by statement (forward mode).

For every calculated number z a generated function calculates its tangent _d_z, the change of z when states, driver,
inputs and parameters change in a given direction:

    propagate_start_tangent     of the states at the start, from initial_state: by parameters
    propagate_constant_tangent  of the constants that prepare calculates: by parameters
    propagate_tangent           of outputs and derivatives, from compute_outputs: by states, driver, inputs, parameters

The right-hand side of each statement is read as an expression, which compiler/equations/algebra.py differentiates as it
does the equations.  Only the statements are walked here: they are those of the lowered model, with the branches, the
forces of stuck contacts and the constants that it calculates.  Where friction sticks, the force equals the load, and
their tangents are equal as well.

References
----------
A. Griewank, A. Walther, Evaluating Derivatives, chapter 3.
"""

import ast
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from math import fabs
from types import FunctionType
from typing import Any

from ...compiler.equations.algebra import build_term, differentiate, differentiate_term
from ...compiler.equations.expression_printer import BINARY_OPERATORS, ExpressionPrinter
from ...compiler.equations.expressions import FUNCTIONS, Expression, Operand, Term
from ...compiler.equations.model_analysis import ANALYSES
from ...compiler.lowering import component_name, function_tree
from ...compiler.lowering.import_hook import TREE_NAME, complete_tree
from ..fmi_variables import DERIVATIVE_NAME, Variables

# Prefix of tangents, and the parameter that holds the direction and the results. No variable of a model starts with _.
PREFIX, TANGENT = "_d_", "_tangent"
# functions beside those of the equations: the friction force under the threshold law, the direction of a planar slip
THRESHOLD, SLIP_DIRECTION = "threshold", "slip_direction"
OPERATIONS = {type(operator): word for word, operator in BINARY_OPERATORS.items()}


class Tangent:
    """A direction and the resulting changes: one float per variable with a tangent, and per constant of prepare."""


def tangent_fields(declarations: Variables) -> dict[str, str]:
    """Return the attribute of Tangent for each variable that has a derivative, or by which others have one."""
    return {
        name: name if name.isidentifier() else f"_{n}"
        for n, (name, meaning) in enumerate(declarations)
        if (meaning.type == "Real" and meaning.causality in ("input", "output", "parameter"))
        or name.startswith(DERIVATIVE_NAME[:4])
    }


def build_tangent_functions(model: Any, declarations: Variables) -> tuple[Tangent, dict[str, FunctionType]]:
    """Build the functions, by name, and an empty Tangent to pass to them."""
    writer = TangentWriter(model, declarations)
    start, prepare, outputs = (
        function_tree(model.__dict__[name]).body for name in ("initial_state", "prepare", "compute_outputs")
    )
    attributes_read = list_attributes(outputs, ast.Load)
    constants = [name for name in list_attributes(prepare, ast.Store) if name in attributes_read]
    point = {"t": "t"} | {name: component_name("y", name) for name in model.states}
    point |= {name: component_name("modes", name) for name in model.contacts}
    begin = parse_statements(f"{name} = solver.{number}" for name, number in point.items())
    bodies = {
        "propagate_start_tangent": begin + writer.differentiate_start(start),
        "propagate_constant_tangent": writer.differentiate_constants(prepare, constants),
        "propagate_tangent": begin + writer.differentiate_outputs(outputs),
    }
    module = sys.modules[model.__module__]
    names = vars(math) | vars(module) | {threshold_tangent.__name__: threshold_tangent}
    functions = {}
    for name, body in bodies.items():
        tree = complete_tree(ast.Module([function_around(name, body)], []))
        own_names = names | {TREE_NAME: tree}
        exec(compile(tree, module.__file__ or "?", "exec", optimize=0), own_names)
        functions[name] = own_names[name]
    tangent = Tangent()
    for field in (*tangent_fields(declarations).values(), *constants):
        setattr(tangent, field, 0.0)
    for field in writer.arrays:
        setattr(tangent, field, [0.0] * len(getattr(model(), field)))
    return tangent, functions


def function_around(name: str, body: list[ast.stmt]) -> ast.FunctionDef:
    """Wrap statements in a function."""
    text = f'def {name}(self, solver, {TANGENT}):\n    """Calculate the directional derivative."""'
    function = ast.parse(text).body[0]
    assert isinstance(function, ast.FunctionDef)
    function.body += remove_unused(body, set())
    return function


def list_attributes(statements: list[ast.stmt], use: type[ast.expr_context]) -> list[str]:
    """Return the attributes that statements read or assign, without repetition."""
    nodes = (node for statement in statements for node in ast.walk(statement) if isinstance(node, ast.Attribute))
    return list(dict.fromkeys(node.attr for node in nodes if isinstance(node.ctx, use)))


def remove_unused(statements: list[ast.stmt], names_read: set[str]) -> list[ast.stmt]:
    """Return statements without assignments to local variables that nothing reads, and without empty conditions.

    `names_read` has the names that later statements read, and receives those of the result.
    """
    result: list[ast.stmt] = []
    for node in reversed(statements):
        match node:
            case ast.Assign(targets=[ast.Name(id=name)]) if name not in names_read:
                continue
            case ast.If():
                body, orelse = (remove_unused(part, names_read) for part in (node.body, node.orelse))
                if not body and not orelse:
                    continue
                node = ast.If(node.test, body or [ast.Pass()], orelse)
        names_read |= {
            part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load)
        }
        result.insert(0, node)
    return result


class TangentWriter:
    """Differentiates the statements of a function; each derivative comes before its statement."""

    def __init__(self, model: Any, declarations: Variables) -> None:
        fields = tangent_fields(declarations)
        self.states, self.contacts = list(model.states), list(model.contacts)
        self.drivers = [name for name, meaning in declarations if meaning.rate]
        self.outputs: dict[str, str] = {}  # attribute -> tangent that a function calculates
        self.seeds: dict[str, str] = {}  # attribute -> tangent that is given
        for name, meaning in declarations:
            if meaning.causality == "output" and name in fields and meaning.role != "state":
                self.outputs[name] = name
            elif meaning.causality in ("input", "parameter") and name in fields:
                self.seeds |= dict.fromkeys((name, f"{name}_polynomial"), fields[name])
        # derivatives of inputs with a declared rate -> the expressions that the rates give for them
        self.input_derivatives = {
            e.name: ast.parse(ExpressionPrinter({}, (), (), 0).text(value), mode="eval").body
            for e, value in ANALYSES[model].declared_derivatives().items()
        }
        self.driver_rates = {fields[DERIVATIVE_NAME.format(name)]: d.rate for name, d in declarations if d.rate}
        self.arrays: list[str] = []  # lists of constants, which have lists of tangents
        self.with_tangent: set[str] = set()  # local variables with a tangent
        self.used_names: set[str] = set()  # of the local variables

    def differentiate_start(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """Return statements that add the changes of the states at the start to their tangents."""
        return self.differentiate(statements, {}, self.states)

    def differentiate_constants(self, statements: list[ast.stmt], constants: list[str]) -> list[ast.stmt]:
        """Return the derivatives of some constants, by which the outputs are differentiated then."""
        self.seeds |= {name: name for name in constants}
        return self.differentiate(statements, {name: name for name in constants})

    def differentiate_outputs(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """Return the derivatives of the outputs and of the rate of the driver."""
        begin = [f"{PREFIX}{name} = {TANGENT}.{name}" for name in self.states]
        end = [f"{TANGENT}.{field} = {TANGENT}.{rate}" for field, rate in self.driver_rates.items()]
        self.with_tangent |= {*self.states}
        return parse_statements(begin) + self.differentiate(statements, self.outputs) + parse_statements(end)

    def differentiate(
        self, statements: list[ast.stmt], results: dict[str, str], result_tangents: Sequence[str] = ()
    ) -> list[ast.stmt]:
        """Return statements and their derivatives.

        Parameters
        ----------
        statements
            Body of a function, or a part of it.
        results
            Attributes whose tangents are calculated, and the names of these tangents.
        result_tangents
            Tangents to which the changes of the returned values are added.
        """
        lines: list[ast.stmt] = []
        self.used_names |= {part.id for node in statements for part in ast.walk(node) if isinstance(part, ast.Name)}
        for node in statements:
            match node:
                case ast.Assign(targets=[ast.Name(id=name)]) if name in self.drivers:  # a state of the importer
                    lines += [*parse_statements([f"{PREFIX}{name} = {TANGENT}.{name}"]), node]
                    self.with_tangent.add(name)
                case ast.Assign(targets=[ast.Name(id=name)]) if name in self.input_derivatives:
                    lines += [*self.assign_tangent(f"{PREFIX}{name}", self.input_derivatives[name]), node]
                    self.with_tangent.add(name)
                case ast.Assign(targets=[ast.Name(id=name)], value=value) if name not in self.contacts:
                    lines += self.assign_tangent(f"{PREFIX}{name}", value, name=name)
                    self.with_tangent.add(name)
                case ast.Assign(targets=[ast.Name()]):
                    lines.append(node)
                case ast.Assign(targets=[ast.Attribute(attr=name)], value=value) if name in results:
                    lines += self.assign_tangent(f"{TANGENT}.{results[name]}", value)
                case ast.Assign(targets=[ast.Subscript(ast.Attribute(attr=name), index)], value=value):
                    self.arrays += [name] if name not in self.arrays else []
                    lines += self.assign_tangent(f"{TANGENT}.{name}[{ast.unparse(index)}]", value)
                case ast.If():
                    branches = (self.differentiate(part, results, result_tangents) for part in (node.body, node.orelse))
                    lines.append(ast.If(node.test, *branches))
                case ast.Return(value=value) if result_tangents and value is not None:
                    starts = value.elts if isinstance(value, ast.Tuple) else [value]
                    for name, start in zip(result_tangents, starts, strict=True):
                        lines += self.assign_tangent(f"{TANGENT}.{name}", start, f"{TANGENT}.{name}")
                    lines.append(ast.Return())
        return lines

    def assign_tangent(self, target: str, value: ast.expr, before: str = "", name: str = "") -> list[ast.stmt]:
        """Return the statements that assign the tangent of a value, added to the tangent with the text `before`.

        With a `name`, they also assign the value to it, and calculate what both have in common once.
        """
        names: dict[Expression, str] = {}
        e, by = self.read_expression(value, names)
        tangent = differentiate(e, by, of_term=term_tangent)
        if before:
            tangent = build_term("+", new_symbol(before, names), tangent)
        printer = ExpressionPrinter(names, (), self.used_names, 0)
        for operand in (tangent, e) if name else (tangent,):
            printer.count_uses(operand)
        printer.emit(f"{target} = {printer.text(tangent)}")
        if name:
            printer.emit(f"{name} = {printer.text(e)}")
        self.used_names = printer.used_names  # a local variable of another statement may have another type
        return parse_statements(printer.lines)

    def read_expression(
        self, value: ast.expr, names: dict[Expression, str]
    ) -> tuple[Operand, dict[Expression, Operand]]:
        """Return a value as an expression, and the tangents of its variables; `names` receives the texts of both."""
        symbols: dict[str, Expression] = {}
        by: dict[Expression, Operand] = {}

        def symbol(e: ast.expr) -> Expression:
            text = ast.unparse(e)
            if text not in symbols:
                symbols[text] = new_symbol(text, names)
                if tangent := self.tangent_text(e):
                    by[symbols[text]] = new_symbol(tangent, names)
            return symbols[text]

        def expression(e: ast.expr) -> Operand:
            match e:
                case ast.Constant(value=float(number)):
                    return number
                case ast.UnaryOp(op=ast.USub(), operand=inner):
                    return Term("neg", expression(inner))
                case ast.BinOp(left=a, op=op, right=b):
                    return Term(OPERATIONS[type(op)], expression(a), expression(b))
                case ast.IfExp(test=test, body=yes, orelse=no):
                    return Term("choose", symbol(test), expression(yes), expression(no))
                case ast.Call(func=ast.Name(id=name), args=args) if name in (THRESHOLD, SLIP_DIRECTION, *FUNCTIONS):
                    return Term(name, *map(expression, args))
            return symbol(e)

        return expression(value), by

    def tangent_text(self, e: ast.expr) -> str:
        """Return the text of the tangent of a variable; empty if it is zero."""
        match e:
            case ast.Name(id=name) if name in self.with_tangent:
                return PREFIX + name
            case ast.Attribute(attr=name) if name in self.seeds:
                return f"{TANGENT}.{self.seeds[name]}"
            case ast.Subscript(value=ast.Attribute(attr=name), slice=index) if name in self.arrays:
                return f"{TANGENT}.{name}[{ast.unparse(index)}]"
            case ast.Call(func=ast.Attribute(value=polynomial, attr="value_at")):
                return self.tangent_text(polynomial)
        return ""


def new_symbol(text: str, names: dict[Expression, str]) -> Expression:
    """Return a symbol for a variable, and note its text."""
    symbol = Expression()
    names[symbol] = text
    return symbol


def term_tangent(e: Term, tangent: Callable[[Operand], Operand]) -> Operand:
    """Return the tangent of a term by the rules of derivatives, given those of its operands.

    The tangent of a function is zero if its argument does not change, even where its slope is infinite.  There,
    another tangent faults; the equations of motion take the slope of sqrt as zero at zero.
    """
    if e.op == THRESHOLD:
        v, eps, load, slide, hold = e.args
        return Term(threshold_tangent.__name__, v, eps, load, hold, *map(tangent, (load, slide, hold)))
    if e.op not in FUNCTIONS or e.op == "fabs":
        return differentiate_term(e, tangent)
    (argument,) = e.args
    slope = Term("/", 0.5, e) if e.op == "sqrt" else FUNCTIONS[e.op](argument, e)
    change = tangent(argument)
    return build_term("choose", Term("==", change, 0.0), 0.0, build_term("*", slope, change))


def threshold_tangent(v, eps, load, hold, d_load, d_slide, d_hold):  # type: ignore[no-untyped-def] # translated to C
    """Tangent of the friction force of the threshold law."""
    if fabs(v) >= eps:
        return d_slide if v > 0.0 else -d_slide
    return d_hold if load > hold else -d_hold if load < -hold else d_load


def parse_statements(lines: Iterable[str]) -> list[ast.stmt]:
    """Parse lines of source."""
    return ast.parse("\n".join(lines)).body
