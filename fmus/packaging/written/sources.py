"""All the files of the runtime and the file of a model, written out."""

from functools import cache
from pathlib import Path
from typing import Any

from ...runtime.variable_declarations import variables
from .. import BuildError, __version__
from ..equations.authored import Authored
from .declarations import Declarations
from .needed import pruned
from .offer import EXACT, Offer
from .spec import Spec
from .text import Line, Writer

FMUS = Path(__file__).resolve().parents[2]
AT_HOME = ("vectors.py", "method_registry.py")  # never travel
PLAIN, APART = "{}", "its_{}_"  # what the numerics call a state: so where its name means something else to them
Files = dict[str, list[Line]]


@cache
def runtime() -> dict[str, str]:
    """Path and text of every file of the numerics and of what hosts them."""
    paths = [path for path in sorted((FMUS / "runtime").glob("*.py")) if path.name not in (*AT_HOME, "__init__.py")]
    return {f"runtime/{path.name}": path.read_text(encoding="utf-8") for path in paths}


@cache
def declarations() -> Declarations:
    """What they say, for any model."""
    return Declarations(runtime().values())


def spec_of(model: Any, offered: Offer, called: str) -> Spec:
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
    return Spec(states, contacts, flags, offered.choices, offered.gone, offered.stepping)


@cache
def written_out(source: Authored, offered: Offer) -> Files:
    """The lines of every file of the runtime and of the file of a model.

    The numbers go by the names of the model, if these mean nothing else in the numerics.
    """
    try:
        return expanded(source, spec_of(source.model, offered, PLAIN))
    except BuildError:
        return expanded(source, spec_of(source.model, offered, APART))


def expanded(source: Authored, spec: Spec) -> Files:
    """The lines with the names of `spec`."""
    file = f"{source.name}.py"
    left = {
        f"runtime/{'linear_closed_form' if label == EXACT else label}.py" for label in spec.gone
    }  # methods that are not offered
    texts = {path: text for path, text in runtime().items() if path not in left} | {file: source.text}
    declared = declarations()
    if name := declared.clash(spec):
        raise BuildError(f"The name {name} means something else in the numerics; take another.")
    files = {path: Writer(spec, declared, path, text, path != file).lines for path, text in texts.items()}
    names = {"." + part for variable, _ in variables(source.model()) for part in variable.split(".")}
    files = pruned(files, file, names)
    return {path: with_origin(path, lines, texts[path], spec) for path, lines in files.items()}


def with_origin(path: str, lines: list[Line], text: str, spec: Spec) -> list[Line]:
    """The lines with one on top that names the source, where they differ from it."""
    if "\n".join(lines) == text:
        return lines
    modes = f"; {', '.join(spec.contacts)}" if spec.contacts else ""
    origin = f"# Written out for {', '.join(spec.states)}{modes} from fmus/{path} of friction-fmus {__version__}."
    return [Line.of(origin, 1), *lines]
