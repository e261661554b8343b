"""What an FMU of either kind carries for people: page, icon, certified result."""

from pathlib import Path

from ..runtime.declare import Declared, Declaring
from .page import page
from .reference import files, reference

ICONS = Path(__file__).with_name("icons")


def companions(model: type[Declaring], name: str, declared: list[tuple[str, Declared]]) -> dict[str, bytes]:
    """Their content, by their paths in the FMU; a model without icon or certified result has none."""
    found, icon = reference(name, declared), ICONS / f"{name}.png"
    entries = {"documentation/index.html": page(model, name, declared, found)}
    if found is not None:
        entries |= files(name, found, declared)
    if icon.is_file():
        entries["model.png"] = icon.read_bytes()
    return entries
