"""All the files of the runtime and the file of a model, written out."""

import ast
from functools import cache
from pathlib import Path
from typing import Any

from ...runtime.declare import Declaring, variables
from .. import BuildError, __version__
from .declarations import Declarations
from .needed import pruned
from .offer import Offer, choices, gone, stepping
from .spec import Spec
from .text import Line, Writer

FMUS = Path(__file__).resolve().parents[2]
AT_HOME = ("vectors.py", "found.py")  # never travel
PLAIN, APART = "{}", "its_{}_"  # what the numerics call a state: so where its name means something else to them
Files = dict[str, list[Line]]


@cache
def runtime() -> dict[str, str]:
    """Path and text of every file of the numerics and of what hosts them."""
    paths = [path for path in sorted((FMUS / "runtime").glob("*.py")) if path.name not in (*AT_HOME, "__init__.py")]
    return {f"runtime/{path.name}": path.read_text(encoding="utf-8") for path in paths}


def spec_of(model: type[Declaring], offered: Offer | None, called: str = PLAIN) -> Spec:
    """What a model and an offer fix; `called`: as its states, rates and modes are."""
    thing: Any = model()
    dry = bool(thing.contacts)
    closed = thing.linear and (offered is None or offered.closed)
    same = {flag: getattr(thing, flag) for flag in ("waits", "coupled", "driven", "ramps")}
    flags = {"dry": dry, "linear": closed} | same
    states, contacts = (
        {called.format(name): other and called.format(other) for name, other in pairs.items()}
        for pairs in (thing.states, thing.contacts)
    )
    return Spec(states, contacts, flags, choices(model, offered), gone(offered), stepping(offered))


def written_out(model: type[Declaring], file: str, text: str, offered: Offer | None = None) -> Files:
    """The lines of every file of the runtime and of the file of a model.

    The numbers go by the names of the model, if these mean nothing else in the numerics.
    """
    try:
        return expanded(spec_of(model, offered), model, file, text)
    except BuildError:
        return expanded(spec_of(model, offered, APART), model, file, text)


def expanded(spec: Spec, model: type[Declaring], file: str, text: str) -> Files:
    """The lines with the names of `spec`."""
    texts = runtime() | {file: text}
    declared = Declarations([ast.parse(text, path) for path, text in texts.items() if path != file])
    if name := declared.clash(spec):
        raise BuildError(f"The name {name} means something else in the numerics; take another.")
    files = {path: Writer(spec, declared, path, text, path != file).lines for path, text in texts.items()}
    names = {"." + part for variable, _ in variables(model()) for part in variable.split(".")}
    files = pruned(files, file, names)
    return {path: with_origin(path, lines, texts[path], spec) for path, lines in files.items()}


def with_origin(path: str, lines: list[Line], text: str, spec: Spec) -> list[Line]:
    """The lines with one on top that names the source, where they differ from it."""
    if "\n".join(lines) == text:
        return lines
    modes = f"; {', '.join(spec.contacts)}" if spec.contacts else ""
    origin = f"# Written out for {spec.told}{modes} from fmus/{path} of friction-fmus {__version__}."
    return [Line.of(origin, 1), *lines]
