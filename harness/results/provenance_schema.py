"""Keys of a provenance file, and their validation."""

from dataclasses import dataclass, field
from typing import Annotated, Any

from ..scenes.schema import Constraint, field_names, parse_table

MAX_DEPTH = 6  # of tables and lists within a scene


def is_shallow(value: object, depth: int = MAX_DEPTH) -> bool:
    """Return whether tables and lists are nested in at most `depth` levels."""
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return items is None or (depth > 0 and all(is_shallow(item, depth - 1) for item in items))


STRING = Constraint(lambda value: isinstance(value, str), "a text")
DIGEST = Constraint(lambda value: isinstance(value, str) and len(value) == 64, "a SHA-256 digest")
VALUE = Constraint(lambda value: is_shallow(value, 3) and not isinstance(value, dict), "a value")
SETTINGS = Constraint(lambda value: isinstance(value, dict | None) and is_shallow(value), "a table, or null")


@dataclass(frozen=True)
class StoredParameter:
    """Effective value and unit of a parameter."""

    value: Annotated[Any, VALUE]
    unit: Annotated[str, STRING]


@dataclass(frozen=True)
class StoredCall:
    """Name of the command that made a result, and the values of its arguments and options."""

    name: Annotated[str, STRING]
    options: dict[str, Annotated[Any, VALUE]]


@dataclass(frozen=True)
class ProvenanceKeys:
    """Keys of a provenance file; those with a default are missing in files of earlier versions."""

    command: Annotated[str, STRING]
    date: Annotated[str, STRING]
    files: dict[str, Annotated[str, DIGEST]]
    parameters: dict[str, StoredParameter]
    scene: Annotated[Any, SETTINGS]
    source: Annotated[str, STRING] = ""
    platform: Annotated[str, STRING] = ""
    versions: dict[str, Annotated[str, STRING]] = field(default_factory=dict)
    run: Annotated[Any, SETTINGS] = None
    replaced: Annotated[str, STRING] = ""
    call: StoredCall | None = None


def select_valid_keys(content: dict[str, Any]) -> dict[str, Any]:
    """Return the known keys of a provenance file with their values.

    Raises
    ------
    SceneError
        If a value is not valid, or a required key is missing.
    """
    content = {name: value for name, value in content.items() if name in field_names(ProvenanceKeys)}
    parse_table(content, ProvenanceKeys)
    return content
