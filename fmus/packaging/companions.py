"""What an FMU of any kind carries for people: page, icon, certified result."""

from pathlib import Path

from ..runtime.declare import Declared, Declaring
from .edition import FMI2, Edition
from .page import page
from .reference import files, reference

ICONS = Path(__file__).with_name("icons")


def companions(
    model: type[Declaring], name: str, declared: list[tuple[str, Declared]], edition: Edition = FMI2
) -> dict[str, bytes]:
    """Their content, by their paths in the FMU; a model without icon or certified result has none."""
    found, icon = reference(name, declared), ICONS / f"{name}.png"
    entries = {"documentation/index.html": page(model, name, declared, found, edition)}
    if found is not None:
        entries |= files(name, found, declared)
    if icon.is_file():
        entries[edition.icon] = icon.read_bytes()
    return entries
