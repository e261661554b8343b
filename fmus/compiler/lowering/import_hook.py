"""Imports lowered models into this process, with the line numbers of the original sources in tracebacks."""

import ast
import inspect
import sys
from functools import cache
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from textwrap import dedent
from types import FunctionType, ModuleType
from typing import Any

from ...runtime import variable_declarations
from ...runtime.variable_declarations import VariableOwner
from ..embedded_modules import digest
from ..equations.model_analysis import ANALYSES
from ..equations.model_file import ModelFile
from ..model_lookup import FMUS, find_model
from .feature_selection import FeatureSelection, select_features
from .lowered_modules import lower_all, lowered_texts

LOAD, STORE, DELETE = ast.Load(), ast.Store(), ast.Del()
TARGETS = ("target", "targets", "optional_vars")  # fields with what a statement stores, or deletes
GROUPS = (ast.Tuple, ast.List, ast.Starred)  # targets whose parts are targets
TREE_NAME = "written_out"  # attribute of lowered modules: the tree with source line numbers


def resolve_features(
    source: str | Path | ModelFile, features: FeatureSelection | None
) -> tuple[ModelFile, FeatureSelection]:
    """Return the model file, and the features, by default all."""
    result = source if isinstance(source, ModelFile) else find_model(source)
    return result, features or select_features(result)


def lowered_files(source: str | Path | ModelFile, features: FeatureSelection | None = None) -> dict[str, str]:
    """Return the text of every lowered file of the runtime and the model, by path."""
    return lowered_texts(*resolve_features(source, features))


def lowered_model(source: str | Path | ModelFile, features: FeatureSelection | None = None) -> type[VariableOwner]:
    """Return the lowered class of a model, imported with its lowered runtime; cached."""
    return import_lowered(*resolve_features(source, features))


@cache
def import_lowered(source: ModelFile, features: FeatureSelection) -> type[VariableOwner]:
    """Import the model class from a package of its lowered files with a unique name."""
    texts, name = lowered_texts(source, features), source.name
    package = f"lowered_{name}_{digest(texts)[:12]}"
    for parent in package, f"{package}.runtime":
        sys.modules[parent] = ModuleType(parent)
        sys.modules[parent].__path__ = []
    sys.modules[f"{package}.runtime.variable_declarations"] = (
        variable_declarations  # declarations keep their classes, for isinstance
    )
    files = {f"{name}.py": f"generated/{name}.py"}
    sys.meta_path.insert(0, LoweredModuleFinder(package, texts, lower_all(source, features), files))
    result = vars(import_module(f"{package}.{name}"))[source.class_name]
    result.real_only = features.real_only  # variable_declarations.py is not lowered here
    ANALYSES[result] = source.analysis
    return result


class LoweredModuleFinder(MetaPathFinder, Loader):
    """Finds and loads the modules of one lowered package."""

    def __init__(
        self, package: str, texts: dict[str, str], trees: dict[str, ast.Module], places: dict[str, str]
    ) -> None:
        self.package, self.texts, self.trees, self.places = package, texts, trees, places

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if self.path(fullname) in self.texts else None

    def path(self, fullname: str) -> str:
        return fullname.removeprefix(f"{self.package}.").replace(".", "/") + ".py"

    def exec_module(self, module: ModuleType) -> None:
        path = self.path(module.__name__)
        tree = complete_tree(self.trees[path])
        module.__file__ = str(self.places.get(path, FMUS / path))
        vars(module)[TREE_NAME] = tree
        exec(compile(tree, module.__file__, "exec", optimize=0), vars(module))


def complete_tree(node: Any, line: int = 1, context: ast.expr_context = LOAD) -> Any:
    """Return a copy of a tree with line numbers and contexts, for the compiler; nodes without a line have that of their
    statement."""
    line = getattr(node, "lineno", line)
    target_context = DELETE if isinstance(node, ast.Delete) else STORE
    fields = {}
    for name, value in ast.iter_fields(node):
        inner = target_context if name in TARGETS else context if isinstance(node, GROUPS) else LOAD
        if isinstance(value, list):
            value = [complete_tree(part, line, inner) if isinstance(part, ast.AST) else part for part in value]
        elif isinstance(value, ast.AST) and name != "ctx":
            value = complete_tree(value, line, inner)
        fields[name] = value
    if "ctx" in node._fields:
        fields["ctx"] = context
    copy = type(node)(**fields)
    if "lineno" in copy._attributes:
        copy.lineno, copy.col_offset = line, 0
    return copy


def sibling_module(model: type[VariableOwner], path: str) -> Any:
    """Return a module of the package of a lowered model, such as `runtime.call_sequence`."""
    return import_module(f"{model.__module__.split('.', 1)[0]}.{path}")


def model_exchange_run(model: type[VariableOwner]) -> tuple[Any, Any]:
    """Create an instance of a lowered model and its run for model exchange."""
    exchange = sibling_module(model, "runtime.model_exchange")
    instance = model()
    run = exchange.ModelExchangeRun(instance)
    exchange.update_nominals(run, instance)
    return instance, run


def function_tree(function: FunctionType) -> ast.FunctionDef:
    """Return the syntax tree of a function with its source line numbers; lowered functions have lowered trees."""
    if TREE_NAME not in function.__globals__:
        result = ast.parse(dedent(inspect.getsource(function))).body[0]
        ast.increment_lineno(result, function.__code__.co_firstlineno - 1)
    else:
        result = function.__globals__[TREE_NAME]
        for name in function.__qualname__.split("."):
            result = next(statement for statement in reversed(result.body) if getattr(statement, "name", "") == name)
    assert isinstance(result, ast.FunctionDef)
    return result
