"""The models there are: every public file of `fmus/`, and in it the class of the same name."""

from importlib import import_module
from pathlib import Path

from ..runtime.declare import Declaring
from . import BuildError

FMUS = Path(__file__).resolve().parent.parent


def names() -> list[str]:
    """The name of every model, in alphabetical order."""
    return sorted(path.stem for path in FMUS.glob("*.py") if not path.stem.startswith("_"))


def load(name: str) -> type[Declaring]:
    """The class of the model `name`."""
    if name not in names():
        raise BuildError(f"There is no model {name!r}; known are {', '.join(names())}.")
    model = getattr(import_module(f"fmus.{name}"), name.capitalize(), None)
    if not (isinstance(model, type) and issubclass(model, Declaring)):
        raise BuildError(f"fmus/{name}.py declares no class {name.capitalize()}; a model derives from Declaring.")
    return model
