"""Finds models: those in `fmus/` and `fmus/more/` by name, all others by the path of their file."""

from pathlib import Path

from . import BuildError
from .equations.model_file import ModelFile, load_model_file

FMUS = Path(__file__).resolve().parent.parent
MORE = FMUS / "more"


def model_names() -> list[str]:
    """Return the names of the models that are built by default, sorted."""
    return sorted(path.stem for path in FMUS.glob("*.py") if not path.stem.startswith("_"))


def more_model_names() -> list[str]:
    """Return the names of the models in `fmus/more/`, sorted."""
    return sorted(path.stem for path in MORE.glob("*.py"))


def find_model(source: str | Path) -> ModelFile:
    """Load a model by name, or by the path of a .py file."""
    path = Path(source)
    if path.suffix == ".py":
        if not path.is_file():
            raise BuildError(f"There is no file {path}.")
        return load_model_file(path)
    names = model_names() + more_model_names()
    if str(source) not in names:
        raise BuildError(
            f"There is no model {str(source)!r}; choose one of {', '.join(names)}, or give the path of a .py file."
        )
    return load_model_file((FMUS if str(source) in model_names() else MORE) / f"{source}.py")
