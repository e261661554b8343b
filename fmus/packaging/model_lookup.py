"""Where models are: those of `fmus/`, one a file, by their names; any other by the path of its file."""

from pathlib import Path

from . import BuildError
from .equations.model_file import ModelFile, load_model_file

FMUS = Path(__file__).resolve().parent.parent


def model_names() -> list[str]:
    """The name of every model of the project, in alphabetical order."""
    return sorted(path.stem for path in FMUS.glob("*.py") if not path.stem.startswith("_"))


def find_model(source: str | Path) -> ModelFile:
    """The model of a name, or in the file of a path, which has the ending .py."""
    path = Path(source)
    if path.suffix == ".py":
        if not path.is_file():
            raise BuildError(f"There is no file {path}.")
        return load_model_file(path)
    if str(source) not in model_names():
        raise BuildError(
            f"There is no model {str(source)!r}; known are {', '.join(model_names())}, and any .py file by its path."
        )
    return load_model_file(FMUS / f"{source}.py")
