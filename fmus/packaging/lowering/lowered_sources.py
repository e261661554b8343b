"""Lowers all files of the runtime and the file of a model."""

from functools import cache
from pathlib import Path
from typing import Any

from ...runtime.variable_declarations import variables
from .. import BuildError, __version__
from ..equations.model_file import ModelFile
from .dead_code import remove_dead_code
from .emit_source import SourceEmitter, SourceLine
from .feature_selection import EXACT, FeatureSelection
from .layout import ModelLayout
from .source_symbols import SourceSymbols

FMUS_FOLDER = Path(__file__).resolve().parents[2]
BUILD_TIME_ONLY = ("vectors.py", "method_registry.py")  # never embedded
PLAIN_NAME, SUFFIXED_NAME = (
    "{}",
    "its_{}_",
)  # name of a state in the runtime; the second form avoids name clashes
SourceFiles = dict[str, list[SourceLine]]


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
    return SourceSymbols(runtime_sources().values())


def model_layout(model: Any, features: FeatureSelection, name_format: str) -> ModelLayout:
    """Return the layout of a model; `name_format` formats the names of states, rates and modes."""
    flags = {
        flag: getattr(model, flag)
        for flag in (
            *("has_dry_friction", "rests_when_stuck", "is_coupled", "has_driver", "has_input_derivatives"),
            "has_conditions",
        )
    }
    flags["is_linear"] = EXACT in features.methods
    states, contacts = (
        {name_format.format(name): other and name_format.format(other) for name, other in pairs.items()}
        for pairs in (model.states, model.contacts)
    )
    return ModelLayout(states, contacts, flags, features.choices, features.excluded, features.stepping_methods)


@cache
def lower_all(source: ModelFile, features: FeatureSelection) -> SourceFiles:
    """Lower all runtime files and the file of a model.

    Components have the names of the model unless these clash with names of the runtime.
    """
    try:
        return lower_with_layout(source, model_layout(source.model, features, PLAIN_NAME))
    except BuildError:
        return lower_with_layout(source, model_layout(source.model, features, SUFFIXED_NAME))


def lower_with_layout(source: ModelFile, spec: ModelLayout) -> SourceFiles:
    """Lower with the names of a layout."""
    file = f"{source.name}.py"
    modules = {label: "linear_closed_form" if label == EXACT else label for label in spec.excluded}
    excluded = {f"runtime/{module}.py" for module in modules.values()}
    texts = {path: text for path, text in runtime_sources().items() if path not in excluded} | {
        file: source.generated_source
    }
    declared = runtime_symbols()
    if name := declared.find_name_clash(spec):
        raise BuildError(f"The numerics already use the name {name}; take another name.")
    files = {path: SourceEmitter(spec, declared, path, text, path != file).lines for path, text in texts.items()}
    names = {"." + part for variable, _ in variables(source.model()) for part in variable.split(".")}
    files = remove_dead_code(files, file, names)
    return {path: add_origin_line(path, lines, texts[path], spec) for path, lines in files.items()}


def add_origin_line(path: str, lines: list[SourceLine], text: str, spec: ModelLayout) -> list[SourceLine]:
    """Add a first line that names the source if the file differs from it."""
    if "\n".join(lines) == text:
        return lines
    modes = f"; {', '.join(spec.contacts)}" if spec.contacts else ""
    origin = f"# Generated for {', '.join(spec.states)}{modes} from fmus/{path} of friction-fmus {__version__}."
    return [SourceLine.of(origin, 1), *lines]
