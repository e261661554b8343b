"""What an FMU of any kind carries for people: page, icon, known boundaries, certified result."""

from pathlib import Path

from ..runtime.declare import Declared, Declaring
from .edition import FMI2, Edition
from .page import page
from .reference import files, reference


def companions(
    model: type[Declaring], path: Path, declared: list[tuple[str, Declared]], edition: Edition = FMI2
) -> dict[str, bytes]:
    """Their content, by their paths in the FMU; a model has an icon, known boundaries (harness/studies/sweep)
    and a certified result if they lie beside its file at `path`, under the same name."""
    name, icon, boundaries = path.stem, path.with_suffix(".png"), path.with_suffix(".toml")
    found = reference(path, declared)
    entries = {"documentation/index.html": page(model, name, declared, found, edition)}
    if found is not None:
        entries |= files(name, found, declared)
    if icon.is_file():
        entries[edition.icon] = icon.read_bytes()
    if boundaries.is_file():
        entries["documentation/boundaries.toml"] = boundaries.read_bytes()
    return entries
