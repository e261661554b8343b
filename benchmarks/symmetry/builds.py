"""The FMUs of a model, built once for the present sources."""

import sys
from functools import cache
from hashlib import sha256
from pathlib import Path

from fmus.compiler import BuildError
from fmus.compiler.model_lookup import MORE, find_model, model_names, more_model_names
from fmus.packaging import __file__ as packaging_file
from harness.errors import HarnessError

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "tests" / "example_models"
PYTHON, NATIVE, FMI3 = "python", "native", "fmi3"
BACKENDS = (PYTHON, NATIVE, FMI3)
PLATFORM = {"linux": "linux64", "darwin": "darwin64", "win32": "win64"}.get(sys.platform, "linux64")


def all_models() -> list[Path]:
    """Return the files of all models: those of fmus, fmus/more and tests/example_models."""
    main_models = [MORE.parent / f"{name}.py" for name in model_names()]
    more_models = [MORE / f"{name}.py" for name in more_model_names()]
    return [*main_models, *more_models, *sorted(EXAMPLES.rglob("*.py"))]


def model_label(source: Path) -> str:
    """Return the name of a model; with its folder, if a shipped model has the same name."""
    name = source.stem
    is_shipped = source.suffix == ".fmu" or source.parent in (MORE, MORE.parent)
    return f"{source.parent.name}/{name}" if not is_shipped and name in model_names() + more_model_names() else name


def find_source(model: str) -> Path:
    """Return the file of a model, given by its label or its path; raise HarnessError if there is none."""
    labels = {model_label(path): path for path in all_models()}
    try:
        return labels[model] if model in labels else find_model(model).path
    except BuildError as error:
        raise HarnessError(str(error)) from None


@cache
def digest_sources() -> str:
    """Return a digest of all files that determine a build, besides the model."""
    digest = sha256()
    folder = Path(packaging_file).parents[1]
    for file in sorted(path for path in folder.rglob("*") if path.suffix in (".py", ".c", ".h")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def build_fmu(folder: Path, source: Path, backend: str) -> Path:
    """Return the FMU of a model file for one backend; build it if `folder` does not have it.

    Raises
    ------
    BuildError
        If the model is refused.
    """
    key = sha256(source.read_bytes()).hexdigest()[:12]
    out = folder / digest_sources() / f"{source.stem}-{key}" / backend
    fmu = out / f"{source.stem}.fmu"
    if not fmu.is_file():
        if backend == PYTHON:
            from fmus.packaging.archive import build as build_python

            build_python(source, out, (), (), (PLATFORM,))
        else:
            from fmus.packaging.native.native_fmu import build as build_native  # needs optional packages

            build_native(source, out, (), (), (PLATFORM,), "3" if backend == FMI3 else "2")
    return fmu
