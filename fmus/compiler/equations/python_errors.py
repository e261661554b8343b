"""Explains Python exceptions in model files, and finds statements of a model class that have no effect."""

import ast
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from inspect import Parameter as Argument
from inspect import signature
from traceback import FrameSummary, extract_tb
from typing import Any

from ... import __all__ as EXPORTED_NAMES
from . import expressions, model_declaration, tables
from .expressions import FUNCTIONS, NO_VALUE, ModelError
from .model_declaration import Model, Rule, Variable, signature_text

EXPORTED_OBJECTS = {
    name: value
    for module in (expressions, model_declaration, tables)
    for name, value in vars(module).items()
    if name in EXPORTED_NAMES
}
DECLARATIONS = [
    name for name, value in EXPORTED_OBJECTS.items() if isinstance(value, type) and issubclass(value, (Variable, Rule))
]
MISSING_FUNCTIONS = ("floor", "ceil", "trunc", "fmod", "atan2", "hypot", "log10", "log2", "pow", "cbrt")  # of math
OTHER_NAMES = {  # arguments of other programs and of earlier versions -> the argument that has this meaning
    **dict.fromkeys(("min", "minimum", "lower"), "low"),
    **dict.fromkeys(("max", "maximum", "upper"), "high"),
    **dict.fromkeys(("init", "initial", "value", "default"), "start"),
    **dict.fromkeys(("der", "derivative_of", "derivative"), "rate_of"),
    **{"finest": "nominal_velocity", "nominal": "nominal_velocity", "description": "text", "equation": "expression"},
}


def explain(error: BaseException, tree: ast.Module, file: str) -> ModelError:
    """Return an exception that a model file raises as a ModelError with the line of the file."""
    frames = [frame for frame in extract_tb(error.__traceback__) if frame.filename == file]
    line = (frames[-1].lineno if frames else None) or 1
    sentence = ""
    if isinstance(error, NameError):
        sentence = explain_name(error.name or "", tree, line)
    elif isinstance(error, TypeError) and "ufunc" in str(error):
        sentence = NO_VALUE.format(name="an expression")
    elif isinstance(error, ImportError) and error.name == __package__.split(".")[0]:
        sentence = str(error).partition(" (")[0]
    elif isinstance(error, TypeError) and frames:
        sentence = explain_call(tree, frames[-1])
    return ModelError(sentence or " ".join(f"{type(error).__name__}: {error}".split()), (file, line))


def explain_name(name: str, tree: ast.Module, line: int) -> str:
    """Return the message for an undefined name."""
    assigned_lines = {
        node.id: node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }
    if assigned_lines.get(name) == line:
        return f"{name} is used in its own declaration: it gets a value only at the end of this line"
    if assigned_lines.get(name, 0) > line:
        return (
            f"{name} is used before its declaration in line {assigned_lines[name]}: Python runs the file from top to "
            "bottom, so declare each name before the line that uses it"
        )
    if name in assigned_lines:
        return (
            f"{name} is a name of the class body, which comprehensions, lambdas and functions do not see: write a for "
            f"loop, or pass it as an argument"
        )
    if name in ("t", "time"):
        return f'{name} is not defined: for the time, declare a state such as clock = State("s", "time", rate=1.0)'
    if name == "self":
        return "self is not defined: write the names of the variables without self"
    if name in EXPORTED_NAMES:
        return f"{name} is not imported: write from fmus import {name}"
    if name == "sign":
        return "sign is not defined: declare dry friction as a Contact, and write other laws with choose or tanh"
    if name in MISSING_FUNCTIONS:
        return f"{name} is no function of fmus, which has {', '.join(FUNCTIONS)}, and choose(condition, this, that)"
    close = get_close_matches(name, [*assigned_lines, *DECLARATIONS, *FUNCTIONS], 1, 0.7)
    return f"{name} is not defined: " + (f"the nearest name is {close[0]}" if close else "declare it before this line")


def explain_call(tree: ast.Module, frame: FrameSummary) -> str:
    """Return the message for wrong arguments of a declaration or function of fmus; empty if the call is another."""
    for call in ast.walk(tree):
        if isinstance(call, ast.Call) and (call.lineno, call.col_offset) == (frame.lineno, frame.colno):
            name = getattr(call.func, "id", getattr(call.func, "attr", ""))
            if callable(EXPORTED_OBJECTS.get(name)):
                return explain_arguments(name, EXPORTED_OBJECTS[name], call)
    return ""


def explain_arguments(name: str, function: Any, call: ast.Call) -> str:
    """Return the message for arguments that do not fit the signature."""
    arguments = signature(function).parameters
    usage = f"write {name}{signature_text(function)}"
    by_position = [argument for argument in arguments.values() if argument.kind is Argument.POSITIONAL_OR_KEYWORD]
    names = [argument.name for argument in by_position[: len(call.args)]] + [
        argument.arg or "" for argument in call.keywords
    ]
    if len(call.args) > len(by_position):
        return f"{name} takes at most {len(by_position)} arguments without a name, got {len(call.args)}: {usage}"
    takes_all = any(argument.kind is Argument.VAR_KEYWORD for argument in arguments.values())
    for word in names if not takes_all else ():
        if word not in arguments:
            close = [OTHER_NAMES.get(word, ""), *get_close_matches(word, arguments, 1)]
            nearest = next((f", the nearest is {argument}" for argument in close if argument in arguments), "")
            return f"{name} has no argument {word}{nearest}: {usage}"
    if missing_names := [
        argument.name for argument in by_position if argument.default is argument.empty and argument.name not in names
    ]:
        return f"{name} lacks the argument {' and '.join(missing_names)}: {usage}"
    return ""


def check_statements(tree: ast.Module, model: type[Model], file: str) -> None:
    """Raise ModelError for statements in the class body that have no effect on the model."""
    for statement in class_statements(tree, model.__name__):
        match statement:
            case (
                ast.Assign(targets=[ast.Attribute(value=ast.Name(id=name), attr=argument)])
                | ast.AugAssign(target=ast.Attribute(value=ast.Name(id=name), attr=argument))
            ) if isinstance(vars(model).get(name), Variable):
                raise ModelError(
                    f"{name}.{argument} is set after the declaration of {name}: write {argument}=... in that line",
                    (file, statement.lineno),
                )
            case ast.Expr(value=ast.Call(func=ast.Name(id=name))) if name in DECLARATIONS:
                target = "rules" if name == Rule.__name__ else "name"
                raise ModelError(
                    f"this {name} belongs to no name, so the model does not have it: write {target} = {name}(...)",
                    (file, statement.lineno),
                )
            case ast.Expr(value=ast.BinOp() | ast.Compare() | ast.UnaryOp() | ast.Name()):
                raise ModelError(
                    "this line has no effect: an equation is written as name = Output(unit, text, expression)",
                    (file, statement.lineno),
                )
            case ast.AnnAssign(target=ast.Name(id=name), value=None):
                raise ModelError(
                    f"{name} has a type but no value: declare it, for example with Parameter", (file, statement.lineno)
                )


def class_statements(tree: ast.Module, model: str) -> Iterator[ast.stmt]:
    """Return all statements in the body of the model class, also within loops and conditions."""
    bodies: list[Iterable[ast.AST]] = [
        node.body for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and node.name == model
    ]
    while bodies:
        for statement in bodies.pop():
            if isinstance(statement, ast.stmt) and not isinstance(statement, (ast.FunctionDef, ast.ClassDef)):
                yield statement
                bodies.append(ast.iter_child_nodes(statement))
