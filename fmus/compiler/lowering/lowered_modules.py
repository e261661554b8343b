"""Lowers all files of the runtime and the file of a model."""

import ast
from dataclasses import replace
from functools import cache
from pathlib import Path

from ...runtime.oscillator import Oscillator
from .. import __version__
from ..equations import model_class
from ..equations.model_file import ModelFile
from ..syntax_trees import all_nodes, parsed_nodes
from .feature_selection import EXACT, HYBRID, FeatureSelection
from .layout import ModelLayout
from .module_lowering import FileLowerer
from .unused_code import remove_unused_code
from .vector_symbols import SourceSymbols

FMUS_FOLDER = Path(__file__).resolve().parents[2]
BUILD_TIME_ONLY = ("vectors.py", "linear_solver.py", "method_registry.py")  # never embedded
LoweredFiles = dict[str, ast.Module]  # by path; statements have the lines of their sources


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
        features.excluded,
        features.stepping_methods,
    )
    zeros = zero_jacobian_entries(source.generated_source, layout)
    angles = tuple(s.name for s in analysis.angles)
    planar = tuple(c.mode.name for c in analysis.planar_contacts)
    return replace(layout, zeros=zeros, n_conditions=len(analysis.conditions), angles=angles, planar=planar)


def zero_jacobian_entries(text: str, spec: ModelLayout) -> frozenset[tuple[int, int]]:
    """Return the entries of the Jacobian for which the source of a model returns the number 0.0 on every path."""
    (method,) = (node for node in parsed_nodes(text) if isinstance(node, ast.FunctionDef) and node.name == "jacobian")
    returned = [node.value for node in all_nodes(method) if isinstance(node, ast.Return)]
    rows = [value.elts for value in returned if isinstance(value, ast.Tuple)]
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
    modules = {label: "linear_closed_form" if label == EXACT else label for label in spec.excluded}
    excluded = {f"runtime/{module}.py" for module in modules.values()}
    excluded |= set() if spec.planar else {"runtime/planar_contact.py"}
    texts = {path: text for path, text in runtime_sources().items() if path not in excluded} | {
        file: source.generated_source
    }
    declared = runtime_symbols()
    files = {path: FileLowerer(spec, declared, path, text, path != file).tree for path, text in texts.items()}
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
