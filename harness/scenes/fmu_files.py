"""Where built FMUs are."""

from pathlib import Path

from ..errors import HarnessError, SceneError, check_names

FOLDERS = (Path("fmus"), Path(__file__).parents[2] / "fmus")


def find_fmu(name: str) -> Path:
    """Where the FMU of a model is, or will be once it is built; a model is named, or is a file that lies anywhere."""
    if (path := Path(name)).suffix in (".py", ".fmu"):
        return path.with_suffix(".fmu")
    if not (names := list_models()):
        raise SceneError("there are no models here: run from the folder of the project, or name fmu = 'a/file.fmu'")
    check_names("model", [name], names)
    return next((file for folder in FOLDERS for file in folder.glob(f"{name}.fmu")), Path("fmus") / f"{name}.fmu")


def list_models() -> set[str]:
    """The names of the models here, built or not."""
    return {file.stem for folder in FOLDERS for ending in ("*.fmu", "[!_]*.py") for file in folder.glob(ending)}


def check_built(fmu: Path, error: type[HarnessError] = HarnessError) -> None:
    """The FMU is there."""
    if not fmu.is_file():
        model = fmu.with_suffix(".py")
        what, which = ("it", f" {model}") if model.is_file() and fmu.parent not in FOLDERS else ("the FMUs", "")
        raise error(f"there is no {fmu}: build {what} with `python build_fmus.py{which}`, or name another file")
