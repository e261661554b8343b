"""What an FMU of any kind carries for people: page, icon, known boundaries, certified result."""

from pathlib import Path

from ..runtime.variable_declarations import VariableOwner
from .certified_result import find_certified_result, result_files
from .documentation_page import documentation_page
from .fmi_variables import Variables


def extra_files(
    model: type[VariableOwner], path: Path, declared: Variables, icon: str = "model.png", use: str = ""
) -> dict[str, bytes]:
    """Their content, by their paths in the FMU; a model has an icon, known boundaries (harness/studies/sweep)
    and a certified result if they lie beside its file at `path`, under the same name.  The icon goes to `icon`;
    the page says `use` of the ways to run it."""
    name, picture, boundaries = path.stem, path.with_suffix(".png"), path.with_suffix(".toml")
    found = find_certified_result(path, declared)
    shown = icon if picture.is_file() else ""
    entries = {"documentation/index.html": documentation_page(model, name, declared, found, shown, use)}
    if found is not None:
        entries |= result_files(name, found, declared)
    if picture.is_file():
        entries[icon] = picture.read_bytes()
    if boundaries.is_file():
        entries["documentation/boundaries.toml"] = boundaries.read_bytes()
    return entries
