"""Files for users in FMUs of all kinds: documentation page, icon, known boundaries, certified result."""

from pathlib import Path

from ..runtime.variable_declarations import VariableOwner
from .certified_result import find_certified_result, result_files
from .documentation_page import documentation_page
from .fmi_variables import Variables


def extra_files(
    model: type[VariableOwner], path: Path, declared: Variables, icon: str = "model.png", use: str = ""
) -> dict[str, bytes]:
    """Return the content of these files by path in the FMU.

    Icon (.png), known boundaries (.toml, see harness/studies/sweep) and certified result (.csv) are optional and stand
    next to the model file at `path`, under the same name.  `icon` is the path of the icon in the FMU; `use` is a
    paragraph of the page on how to run the FMU.
    """
    name, picture, boundaries = path.stem, path.with_suffix(".png"), path.with_suffix(".toml")
    certified = find_certified_result(path, declared)
    icon_path = icon if picture.is_file() else ""
    entries = {"documentation/index.html": documentation_page(model, name, declared, certified, icon_path, use)}
    if certified is not None:
        entries |= result_files(name, certified, declared)
    if picture.is_file():
        entries[icon] = picture.read_bytes()
    if boundaries.is_file():
        entries["documentation/boundaries.toml"] = boundaries.read_bytes()
    return entries
