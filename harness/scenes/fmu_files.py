"""Locations of built FMUs."""

import ast
import shlex
from pathlib import Path

from ..errors import HarnessError, SceneError, format_value, unknown_source_message

PROJECT = Path(__file__).parents[2] / "fmus"
FOLDERS = (Path("fmus"), PROJECT)
MORE = (Path("fmus") / "more", PROJECT / "more")  # folders of models that are not built by default


def find_fmu(name: str) -> Path:
    """Return the path of a model's FMU, whether built or not. A model is given by its name or by a .py or .fmu file."""
    if (path := Path(name)).suffix in (".py", ".fmu"):
        fmu = path.with_suffix(".fmu")
        if not path.exists() and not fmu.exists() and path != fmu:
            raise SceneError(f"{format_value(name)} does not exist: give an existing model file or FMU")
        return fmu
    if not (names := list_models()):
        raise SceneError("no models found: run from the project directory, or set fmu = 'path/to/file.fmu'")
    if name not in names:
        raise SceneError(unknown_source_message("model", name, names))
    folders, default_folder = (MORE, MORE[0]) if name in list_more_models() else (FOLDERS, FOLDERS[0])
    return next((file for folder in folders for file in folder.glob(f"{name}.fmu")), default_folder / f"{name}.fmu")


def fmi3_path(fmu: Path) -> Path:
    """Return the path of the native FMI 3.0 FMU of the same model, built or not."""
    return fmu.parent / "native" / "fmi3" / fmu.name


def list_models() -> set[str]:
    """Return the names of all models, built or not."""
    return _names_in(FOLDERS) | list_more_models()


def list_more_models() -> set[str]:
    """Return the names of the models that are not built by default."""
    return _names_in(MORE) - _names_in(FOLDERS)


def more_model_files() -> list[Path]:
    """Return the files of the models that are not built by default, sorted by name."""
    return sorted(MORE[1].glob("[!_]*.py"))


def model_title(file: Path) -> str:
    """Return the title of a model: the first line of its file, without the full stop."""
    return (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition("\n")[0].rstrip(".")


def _names_in(folders: tuple[Path, ...]) -> set[str]:
    return {file.stem for folder in folders for pattern in ("*.fmu", "[!_]*.py") for file in folder.glob(pattern)}


def build_command(fmu: Path, options: str = "") -> str:
    """Return the command that builds the FMU of this path, in quotes; empty if its model is not known.

    Parameters
    ----------
    fmu : path
        Path of the FMU, built or not.
    options : str
        Other options of the command, as in ``"--fmi 3"``.
    """
    model = fmu.with_suffix(".py")
    default_models, more_models = ({file.stem for file in folder.glob("[!_]*.py")} for folder in (PROJECT, MORE[1]))
    if fmu.stem in default_models and fmu.parent in FOLDERS:
        arguments = []
    elif fmu.stem in more_models and fmu.parent in MORE:
        arguments = [fmu.stem]
    elif model.is_file():
        arguments = [shlex.quote(str(model))]
    elif fmu.stem in default_models | more_models:
        arguments = [fmu.stem, "--out", shlex.quote(str(fmu.parent))]
    else:
        return ""
    return f"`{' '.join(['friction-fmus build', *arguments, *options.split()])}`"


def check_built(fmu: Path, error: type[HarnessError] = HarnessError) -> None:
    """Raise an error that names the build command if the FMU does not exist."""
    if not fmu.is_file():
        command = build_command(fmu)
        remedy = f"build it with {command}, or specify another file" if command else "specify another file"
        raise error(f"there is no {fmu}: {remedy}")
