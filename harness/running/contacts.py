"""Contacts of an FMU of this project: each has a friction force and a mode, and the name of its force."""

import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

MODE_TEXT = re.compile(r"mode of (\w+): ")  # how the description of a mode begins; it names the force of the contact


def contact_of_mode(description: str | None) -> str:
    """Return the friction force that the description of a mode names; empty if it names none."""
    named = MODE_TEXT.match(description or "")
    return named[1] if named else ""


def find_contacts(variables: Mapping[str, Any]) -> dict[str, str]:
    """Return the contacts of an FMU of this project: the output that is the mode, by the name of the contact.

    A contact has the name of its friction force, or that of its mode if the description of the mode names no force.
    """
    modes = [
        variable for variable in variables.values() if (variable.causality, variable.type) == ("output", "Integer")
    ]
    named = {mode.name: contact_of_mode(mode.description) for mode in modes}
    return {force if force in variables else mode: mode for mode, force in named.items()}


def choose_outputs(outputs: Sequence[str], contacts: Collection[str], count: int) -> tuple[str, ...]:
    """Return the first outputs, `count` in all, with the friction forces among them if there is space for these."""
    forces = [name for name in outputs if name in contacts][:count]
    others = [name for name in outputs if name not in contacts][: count - len(forces)]
    return tuple(name for name in outputs if name in forces or name in others)
