"""Contacts of an FMU of this project, from the file resources/contacts.json."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .fmu_archive import cached_by_mtime, read_json_resource

CONTACTS_FILE = "resources/contacts.json"  # fmus/packaging/documentation_page.py writes it


@cached_by_mtime
def read_contacts(fmu: Path) -> dict[str, str]:
    """Return the name of the mode of each contact, by that of its friction force; none for an FMU without the file.

    Raises
    ------
    HarnessError
        If the file is damaged.
    """
    return read_json_resource(fmu, CONTACTS_FILE, parse_contacts) or {}


def parse_contacts(content: Mapping[str, Any]) -> dict[str, str]:
    """Return contacts from their JSON."""
    return {str(force): str(mode) for force, mode in content.items()}
