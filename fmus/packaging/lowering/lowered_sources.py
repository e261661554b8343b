"""All the files of the runtime and the file of a model, written out."""

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
BUILD_TIME_ONLY = ("vectors.py", "method_registry.py")  # never travel
PLAIN_NAME, SUFFIXED_NAME = (
    "{}",
    "its_{}_",
)  # what the numerics call a state: so where its name means something else to them
SourceFiles = dict[str, list[SourceLine]]


@cache
def runtime_sources() -> dict[str, str]:
    """Path and text of every file of the numerics and of what hosts them."""
    paths = [
        path
        for path in sorted((FMUS_FOLDER / "runtime").glob("*.py"))
        if path.name not in (*BUILD_TIME_ONLY, "__init__.py")
    ]
    return {f"runtime/{path.name}": path.read_text(encoding="utf-8") for path in paths}


@cache
def runtime_symbols() -> SourceSymbols:
    """What they say, for any model."""
    return SourceSymbols(runtime_sources().values())


def model_layout(model: Any, offered: FeatureSelection, called: str) -> ModelLayout:
    """What a model and an offer fix; `called`: as its states, rates and modes are."""
    flags = {
        flag: getattr(model, flag)
        for flag in ("has_dry_friction", "rests_when_stuck", "is_coupled", "has_driver", "has_input_derivatives")
    }
    flags["is_linear"] = EXACT in offered.methods
    states, contacts = (
        {called.format(name): other and called.format(other) for name, other in pairs.items()}
        for pairs in (model.states, model.contacts)
    )
    return ModelLayout(states, contacts, flags, offered.choices, offered.excluded, offered.stepping_methods)


@cache
def lower_all(source: ModelFile, offered: FeatureSelection) -> SourceFiles:
    """The lines of every file of the runtime and of the file of a model.

    The numbers go by the names of the model, if these mean nothing else in the numerics.
    """
    try:
        return lower_with_layout(source, model_layout(source.model, offered, PLAIN_NAME))
    except BuildError:
        return lower_with_layout(source, model_layout(source.model, offered, SUFFIXED_NAME))


def lower_with_layout(source: ModelFile, spec: ModelLayout) -> SourceFiles:
    """The lines with the names of `spec`."""
    file = f"{source.name}.py"
    left = {
        f"runtime/{'linear_closed_form' if label == EXACT else label}.py" for label in spec.excluded
    }  # methods that are not offered
    texts = {path: text for path, text in runtime_sources().items() if path not in left} | {
        file: source.generated_source
    }
    declared = runtime_symbols()
    if name := declared.find_name_clash(spec):
        raise BuildError(f"The name {name} means something else in the numerics; take another.")
    files = {path: SourceEmitter(spec, declared, path, text, path != file).lines for path, text in texts.items()}
    names = {"." + part for variable, _ in variables(source.model()) for part in variable.split(".")}
    files = remove_dead_code(files, file, names)
    return {path: add_origin_line(path, lines, texts[path], spec) for path, lines in files.items()}


def add_origin_line(path: str, lines: list[SourceLine], text: str, spec: ModelLayout) -> list[SourceLine]:
    """The lines with one on top that names the source, where they differ from it."""
    if "\n".join(lines) == text:
        return lines
    modes = f"; {', '.join(spec.contacts)}" if spec.contacts else ""
    origin = f"# Written out for {', '.join(spec.states)}{modes} from fmus/{path} of friction-fmus {__version__}."
    return [SourceLine.of(origin, 1), *lines]
