"""Lowers all files of the runtime and the file of a model, and removes what an FMU does not need.

A function is kept if code that is kept contains its name, whatever object has that name there; an import if the file
reads it.
"""

import ast
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TypeGuard

from ...runtime.oscillator import Oscillator
from .. import __version__
from ..equations import model_class
from ..equations.algebra import variables_in
from ..equations.expressions import Operand, is_among
from ..equations.model_analysis import ModelAnalysis
from ..equations.model_file import ModelFile
from ..syntax_trees import all_nodes, parsed_nodes, replace_fields
from .feature_selection import EXACT, HYBRID, FeatureSelection
from .layout import ModelLayout
from .module_lowering import PLANAR_MODULE, FileLowerer
from .vector_symbols import SourceSymbols

FMUS_FOLDER = Path(__file__).resolve().parents[2]
BUILD_TIME_ONLY = ("vectors.py", "linear_solver.py", "method_registry.py")  # never embedded
LoweredFiles = dict[str, ast.Module]  # by path; statements have the lines of their sources
FMI_LAYER = frozenset(  # kept whole: importers and the C sources call its functions
    f"runtime/{name}.py"
    for name in (
        *("call_sequence", "early_return", "failure_handling", "messages", "model_exchange"),
        *("pythonfmu_workarounds", "saved_state", "slave", "variable_access", "variable_declarations"),
    )
)


@cache
def runtime_sources() -> dict[str, str]:
    """Return the text of every embedded runtime file, by path."""
    paths = [
        path
        for path in sorted((FMUS_FOLDER / "runtime").glob("*.py"))
        if path.name not in (*BUILD_TIME_ONLY, "__init__.py")
    ]
    return {f"runtime/{path.name}": path.read_text(encoding="utf-8") for path in paths}


@cache
def runtime_symbols() -> SourceSymbols:
    """Return the symbols of the runtime sources."""
    vectors = (FMUS_FOLDER / "runtime" / "vectors.py").read_text(encoding="utf-8")
    return SourceSymbols(runtime_sources().values(), vectors)


def model_layout(source: ModelFile, features: FeatureSelection) -> ModelLayout:
    """Return the layout of a model."""
    base, analysis = model_class.base_class(source.analysis), source.analysis
    flags = {flag: getattr(base, flag) for flag, default in vars(Oscillator).items() if isinstance(default, bool)}
    flags |= model_class.flags(analysis)
    flags["is_linear"] = EXACT in features.methods
    flags["real_only"] = features.real_only
    flags["has_other_laws"] = any(law != HYBRID for law in features.laws)
    if not (HYBRID in features.laws and flags["has_other_laws"]):
        flags["is_hybrid"] = HYBRID in features.laws
    layout = ModelLayout(
        model_class.rates_of_states(analysis),
        model_class.slips_of_contacts(analysis),
        flags,
        features.choices,
        features.excluded_labels,
        features.stepping_methods,
    )
    zeros = zero_jacobian_entries(source.generated_source, layout)
    angles = tuple(s.name for s in analysis.angles)
    planar = tuple(c.mode.name for c in analysis.planar_contacts)
    slips = ([speeds_in(slip, analysis) for slip in c.slips] for c in analysis.planar_contacts)
    axes = tuple(pair for x, y in slips for pair in zip(x, y, strict=False))
    n_conditions = len(analysis.conditions)
    return replace(layout, zeros=zeros, n_conditions=n_conditions, angles=angles, planar=planar, axes=axes)


def speeds_in(slip: Operand, analysis: ModelAnalysis) -> list[str]:
    """Return the names of the states in a slip, in their order."""
    return [e.name for e in variables_in(slip) if is_among(e, analysis.states)]


def zero_jacobian_entries(text: str, spec: ModelLayout) -> frozenset[tuple[int, int]]:
    """Return the entries of the Jacobian for which the source of a model returns the number 0.0 on every path."""
    (method,) = (node for node in parsed_nodes(text) if isinstance(node, ast.FunctionDef) and node.name == "jacobian")
    results = [node.value for node in all_nodes(method) if isinstance(node, ast.Return)]
    rows = [value.elts for value in results if isinstance(value, ast.Tuple)]
    is_zero = [
        all(isinstance(value, ast.Constant) and value.value == 0.0 for value in column)
        for column in zip(*rows, strict=True)
    ]
    places = [(i, j) for i in spec.dynamic_states for j in range(-1, len(spec.states))]  # -1: derivative by time
    return frozenset(place for place, zero in zip(places, is_zero, strict=True) if zero and place[1] >= 0)


@cache
def lower_all(source: ModelFile, features: FeatureSelection) -> LoweredFiles:
    """Lower all runtime files and the file of a model."""
    spec = model_layout(source, features)
    file = f"{source.name}.py"
    modules = {label: "linear_closed_form" if label == EXACT else label for label in spec.excluded_labels}
    excluded_paths = {f"runtime/{module}.py" for module in modules.values()}
    excluded_paths |= set() if spec.planar else {f"runtime/{PLANAR_MODULE}.py"}
    texts = {path: text for path, text in runtime_sources().items() if path not in excluded_paths} | {
        file: source.generated_source
    }
    symbols = runtime_symbols()
    files = {path: FileLowerer(spec, symbols, path, text, path != file).tree for path, text in texts.items()}
    return remove_unused_code(files)


@cache
def lowered_texts(source: ModelFile, features: FeatureSelection) -> dict[str, str]:
    """Return the text of all lowered files, by path; the first line names the source."""
    spec = model_layout(source, features)
    names = ", ".join(spec.states) + (f"; {', '.join(spec.contacts)}" if spec.contacts else "")
    return {
        path: f"# Generated for {names} from fmus/{path} of friction-fmus {__version__}.\n"
        f"{ast.unparse(ast.fix_missing_locations(tree))}\n"
        for path, tree in lower_all(source, features).items()
    }


def remove_unused_code(files: Mapping[str, ast.Module]) -> dict[str, ast.Module]:
    """Remove unused functions and imports from the files of an FMU."""
    called_by: defaultdict[str, set[str]] = defaultdict(set)  # name of functions -> names in them
    pending_names: list[str] = []  # names in all other code
    for path, tree in files.items():
        for node in tree.body:
            for part in [*node.bases, *node.body] if isinstance(node, ast.ClassDef) else [node]:
                if is_removable(part) and path not in FMI_LAYER:
                    called_by[part.name] |= names_in(part)
                else:
                    pending_names += names_in(part)
    used_names: set[str] = set()
    while pending_names:
        name = pending_names.pop()
        if name not in used_names:
            used_names.add(name)
            pending_names += called_by[name]
    return {path: tree if path in FMI_LAYER else prune(tree, used_names) for path, tree in files.items()}


def is_removable(node: ast.AST) -> TypeGuard[ast.FunctionDef]:
    """Return whether this is a function that runs only if its name is used."""
    return isinstance(node, ast.FunctionDef) and not node.name.startswith("__")


def names_in(root: ast.AST) -> set[str]:
    """Return all names and attributes in some code, and names that it has as text."""
    result = set()
    for node in all_nodes(root):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.Constant(value=str(name)):
                result.add(name)
    return result


def prune(tree: ast.Module, used_names: set[str]) -> ast.Module:
    """Remove functions whose names are not used, then imports that the file does not read."""

    def keep(statements: list[ast.stmt]) -> list[ast.stmt]:
        return [node for node in statements if not (is_removable(node) and node.name not in used_names)]

    body = [
        replace_fields(node, body=keep(node.body) or [ast.copy_location(ast.Pass(), node)])
        if isinstance(node, ast.ClassDef)
        else node
        for node in keep(tree.body)
    ]
    names_read = {name for node in body for name in names_in(node)}
    result: list[ast.stmt] = []
    for node in body:
        if isinstance(node, ast.ImportFrom) and node.module != "__future__":
            aliases = [alias for alias in node.names if (alias.asname or alias.name) in names_read]
            result += [replace_fields(node, names=aliases)] if aliases else []
        else:
            result.append(node)
    return ast.Module(result, [])
