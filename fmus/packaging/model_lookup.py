"""Finds models: those in `fmus/` by name, all others by the path of their file."""

from pathlib import Path

from . import BuildError
from .equations.model_file import ModelFile, load_model_file

FMUS = Path(__file__).resolve().parent.parent


def model_names() -> list[str]:
    """Return the names of all models of the project, sorted."""
    return sorted(path.stem for path in FMUS.glob("*.py") if not path.stem.startswith("_"))


def find_model(source: str | Path) -> ModelFile:
    """Load a model by name, or by the path of a .py file."""
    path = Path(source)
    if path.suffix == ".py":
        if not path.is_file():
            raise BuildError(f"There is no file {path}.")
        return load_model_file(path)
    if str(source) not in model_names():
        raise BuildError(
            f"There is no model {str(source)!r}; choose one of {', '.join(model_names())}, "
            "or give the path of a .py file."
        )
    return load_model_file(FMUS / f"{source}.py")
