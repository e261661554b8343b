"""Contacts of an FMU of this project, from the file resources/contacts.json."""

import json
from pathlib import Path
from zipfile import BadZipFile, ZipFile

from ..errors import HarnessError, first_line
from .fmu_archive import cached_by_mtime

CONTACTS_FILE = "resources/contacts.json"  # fmus/packaging/documentation_page.py writes it


@cached_by_mtime
def read_contacts(fmu: Path) -> dict[str, str]:
    """Return the name of the mode of each contact, by that of its friction force; none for an FMU without the file.

    Raises
    ------
    HarnessError
        If the file is damaged.
    """
    try:
        with ZipFile(fmu) as archive:
            if CONTACTS_FILE not in archive.namelist():
                return {}
            return {str(force): str(mode) for force, mode in json.loads(archive.read(CONTACTS_FILE)).items()}
    except (OSError, BadZipFile, ValueError, AttributeError) as error:
        raise HarnessError(f"{CONTACTS_FILE} of {fmu.name} cannot be read: {first_line(error)}") from None
