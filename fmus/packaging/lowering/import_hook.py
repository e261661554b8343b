"""A model in this process, as it will travel: its lines are those of the source, for tracebacks and refusals."""

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
from ..equations.model_file import ModelFile
from ..model_lookup import FMUS, find_model
from ..syntax_trees import all_nodes
from .feature_selection import FeatureSelection, select_features
from .lowered_sources import PLAIN_NAME, SUFFIXED_NAME, SourceFiles, lower_all

TREE_NAME = "written_out"  # in a module of a written-out package: its tree, with the lines of the source


def resolve_features(
    source: str | Path | ModelFile, offered: FeatureSelection | None
) -> tuple[ModelFile, FeatureSelection]:
    """The model of a name or a path, or of an author's file; and what it offers, which without an offer is all."""
    found = source if isinstance(source, ModelFile) else find_model(source)
    return found, offered or select_features(found)


def lowered_files(source: str | Path | ModelFile, offered: FeatureSelection | None = None) -> dict[str, str]:
    """Path and text of every file of the runtime, and of the model, as they travel."""
    return {path: "\n".join(lines) for path, lines in lower_all(*resolve_features(source, offered)).items()}


def lowered_model(source: str | Path | ModelFile, offered: FeatureSelection | None = None) -> type[VariableOwner]:
    """The class of a model as it will travel, with what the runtime is for it; the same each time."""
    return import_lowered(*resolve_features(source, offered))


@cache
def import_lowered(source: ModelFile, offered: FeatureSelection) -> type[VariableOwner]:
    """The model class out of a package of its files, imported under a name of its own."""
    files, name, model = lower_all(source, offered), source.name, source.model
    package = f"written_{name}_{digest(lowered_files(source, offered))[:12]}"
    for parent in package, f"{package}.runtime":
        sys.modules[parent] = ModuleType(parent)
        sys.modules[parent].__path__ = []
    sys.modules[f"{package}.runtime.variable_declarations"] = (
        variable_declarations  # what is declared is what it is to everybody else
    )
    sys.meta_path.insert(
        0, LoweredModuleFinder(package, files, {f"{name}.py": sys.modules[model.__module__].__file__ or "?"})
    )
    found = vars(import_module(f"{package}.{name}"))[model.__name__]
    found.analysis = source.analysis  # for whoever describes it
    return found


class LoweredModuleFinder(MetaPathFinder, Loader):
    """Finds the modules of one written-out package."""

    def __init__(self, package: str, files: SourceFiles, places: dict[str, str]) -> None:
        self.package, self.files, self.places = package, files, places

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if self.path(fullname) in self.files else None

    def path(self, fullname: str) -> str:
        return fullname.removeprefix(f"{self.package}.").replace(".", "/") + ".py"

    def exec_module(self, module: ModuleType) -> None:
        path = self.path(module.__name__)
        lines = self.files[path]
        tree = ast.parse("\n".join(lines), path)
        for node in all_nodes(tree):
            if isinstance(node, (ast.stmt, ast.expr, ast.excepthandler, ast.arg, ast.keyword, ast.alias)):
                node.lineno, node.col_offset = lines[node.lineno - 1].source, 0
                node.end_lineno = node.end_col_offset = None
        module.__file__ = str(self.places.get(path, FMUS / path))
        vars(module)[TREE_NAME] = tree
        exec(compile(tree, module.__file__, "exec"), vars(module))


def sibling_module(model: type[VariableOwner], path: str) -> Any:
    """A module of the package of a written-out model, as `runtime.call_sequence`."""
    return import_module(f"{model.__module__.split('.', 1)[0]}.{path}")


def scalar_name(thing: Any, name: str) -> str:
    """What the numerics of a written-out model call one of its states or modes."""
    return next(one for one in (SUFFIXED_NAME.format(name), PLAIN_NAME.format(name)) if hasattr(thing.solver, one))


def function_tree(function: FunctionType) -> ast.FunctionDef:
    """The tree of a function, with the lines of its source: as written out, if it is."""
    if TREE_NAME not in function.__globals__:
        found = ast.parse(dedent(inspect.getsource(function))).body[0]
        ast.increment_lineno(found, function.__code__.co_firstlineno - 1)
    else:
        found = function.__globals__[TREE_NAME]
        for name in function.__qualname__.split("."):
            found = next(one for one in reversed(found.body) if getattr(one, "name", "") == name)
    assert isinstance(found, ast.FunctionDef)
    return found
