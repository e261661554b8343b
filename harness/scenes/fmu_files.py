"""Locations of built FMUs."""

from pathlib import Path

from ..errors import HarnessError, SceneError, format_value, unknown_source_message

FOLDERS = (Path("fmus"), Path(__file__).parents[2] / "fmus")


def find_fmu(name: str) -> Path:
    """Return the path of a model's FMU, built or not. A model is given by its name or by a .py or .fmu file."""
    if (path := Path(name)).suffix in (".py", ".fmu"):
        fmu = path.with_suffix(".fmu")
        if not path.exists() and not fmu.exists() and path != fmu:
            raise SceneError(f"{format_value(name)} does not exist: give an existing model file or FMU")
        return fmu
    if not (names := list_models()):
        raise SceneError("no models found: run from the project directory, or set fmu = 'path/to/file.fmu'")
    if name not in names:
        raise SceneError(unknown_source_message("model", name, names))
    return next((file for folder in FOLDERS for file in folder.glob(f"{name}.fmu")), Path("fmus") / f"{name}.fmu")


def list_models() -> set[str]:
    """Return the names of all models, built or not."""
    return {file.stem for folder in FOLDERS for pattern in ("*.fmu", "[!_]*.py") for file in folder.glob(pattern)}


def check_built(fmu: Path, error: type[HarnessError] = HarnessError) -> None:
    """Check that the FMU exists."""
    if not fmu.is_file():
        model = fmu.with_suffix(".py")
        object_name, argument = (
            ("it", f" {model}") if model.is_file() and fmu.parent not in FOLDERS else ("the FMUs", "")
        )
        raise error(
            f"there is no {fmu}: build {object_name} with `python build_fmus.py{argument}`, or specify another file"
        )
