"""Validation of TOML files: converts a table to a dataclass, or reports the first error in one sentence.

The dataclass is the schema. Types carry constraints, as in `Annotated[float, POSITIVE]`.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from itertools import pairwise
from math import isfinite
from pathlib import Path
from types import NoneType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from ..errors import SceneError, format_value, unknown_name_message

LIST_HINT = "`friction-fmus list` lists the available scenes"
MAX_TITLE_LENGTH = 200  # letters
MAX_FILE_BYTES = 1_000_000  # bytes
Schema = TypeVar("Schema")


@dataclass(frozen=True)
class Constraint:
    """Condition for a value, and its description."""

    accepts: Callable[[Any], bool]
    description: str


def is_text(value: object) -> bool:
    """Return whether a value is a non-empty string."""
    return isinstance(value, str) and bool(value)


def is_title(value: object) -> bool:
    """Return whether a value is a single line of limited length."""
    text = str(value)
    return is_text(value) and len(text) <= MAX_TITLE_LENGTH and text.splitlines() == [text] and "\0" not in text


def is_number(value: object) -> bool:
    """Return whether a value is a finite number."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # an integer beyond the range of floats
        return False


def is_whole(value: object, minimum: float, maximum: float) -> bool:
    """Return whether a value is an integer within limits."""
    return isinstance(value, int) and not isinstance(value, bool) and minimum <= value <= maximum


def is_names(value: object) -> bool:
    """Return whether a value is a list of distinct non-empty strings."""
    return isinstance(value, list) and all(map(is_text, value)) and len(set(value)) == len(value)


def is_increasing(value: object) -> bool:
    """Return whether a value is a list of increasing finite numbers."""
    return isinstance(value, list) and all(map(is_number, value)) and all(a < b for a, b in pairwise(value))


TITLE = Constraint(is_title, f"a text of one line and at most {MAX_TITLE_LENGTH} characters")
TEXT = Constraint(is_text, "a text")
NUMBER = Constraint(is_number, "a finite number")
POSITIVE = Constraint(lambda value: is_number(value) and value > 0, "a finite number above 0")
NAMES = Constraint(is_names, "a list of distinct names")
TIMES = Constraint(is_increasing, "a list of increasing finite numbers")
FLAG = Constraint(lambda value: isinstance(value, bool), "true or false")
TABLE = Constraint(lambda value: isinstance(value, dict), "a table")
LIST = Constraint(lambda value: isinstance(value, list), "a list")

PLAIN = {  # constraints of types without any
    str: Constraint(lambda value: isinstance(value, str), "a text"),
    bool: FLAG,
    int: Constraint(lambda value: isinstance(value, int) and not isinstance(value, bool), "a whole number"),
    float: NUMBER,
}

Faults = list[tuple[int, str]]  # rank and message


def parse_table(table: Mapping[str, Any], schema: type[Schema]) -> Schema:
    """Convert a table to its schema; raise SceneError with the most helpful error if it does not fit."""
    faults: Faults = []
    result: Schema = convert(table, schema, "", faults)
    if faults:
        raise SceneError(min(faults)[1])
    return result


def convert(value: Any, annotation: Any, path: str, faults: Faults) -> Any:
    """Return a value as its annotated type; a list becomes a tuple.

    What is wrong is added to `faults`. Rank 0, an unknown key, is the most helpful.
    """
    constraint, origin, arguments = find_constraint(annotation), get_origin(annotation), get_args(annotation)
    if constraint is None and NoneType in arguments:
        (required,) = (one for one in arguments if one is not NoneType)
        return None if value is None else convert(value, required, path, faults)
    if constraint is None:
        is_table = is_dataclass(annotation) or origin in (dict, Mapping)
        constraint = TABLE if is_table else LIST if origin is tuple else PLAIN[annotation]
    if not constraint.accepts(value):
        faults.append((1, f"{path} = {format_value(value)} is not {constraint.description}"))
        return None
    if is_dataclass(annotation):
        return convert_table(value, annotation, path, faults)
    if origin in (dict, Mapping):
        return {key: convert(item, arguments[1], join_key_path(path, key), faults) for key, item in value.items()}
    if origin is tuple:
        return tuple(convert(item, arguments[0], join_key_path(path, i), faults) for i, item in enumerate(value))
    if Path in arguments:
        return Path(value)
    if annotation is float:
        return float(value)
    return tuple(value) if isinstance(value, list) else value


def convert_table(table: Mapping[str, Any], schema: Any, path: str, faults: Faults) -> Any:
    """Return a table whose keys are the fields of a dataclass; the field `from_` holds the key `from`."""
    names = {name.rstrip("_"): name for name in field_names(schema)}
    if unknown := table.keys() - names:
        faults.append((0, unknown_name_message(f"key in [{path}]" if path else "key", min(unknown), names)))
    required = {one.name for one in fields(schema) if one.default is MISSING and one.default_factory is MISSING}
    faults += [
        (2, f"the key '{join_key_path(path, key)}' is missing")
        for key, name in names.items()
        if name in required and key not in table
    ]
    types, n_faults = type_hints(schema), len(faults)
    values = {
        name: convert(table[key], types[name], join_key_path(path, key), faults)
        for key, name in names.items()
        if key in table
    }
    if faults[n_faults:] or required - values.keys():
        return None
    try:
        return schema(**values)
    except ValueError as error:
        faults.append((1, f"{path} = {error}"))


@cache
def type_hints(schema: Any) -> dict[str, Any]:
    """Return the annotated types of the fields of a dataclass."""
    return get_type_hints(schema, include_extras=True)


def find_constraint(annotation: Any) -> Constraint | None:
    """Return the constraint of an annotated type, or None."""
    return next((item for item in getattr(annotation, "__metadata__", ()) if isinstance(item, Constraint)), None)


def field_names(schema: Any) -> list[str]:
    """Return the names of the fields of a dataclass."""
    return [field.name for field in fields(schema)]


def join_key_path(path: str, key: str | int) -> str:
    """Return the path of a key, or of a list item counted from 0."""
    if isinstance(key, int):
        return f"{path}[{key}]"
    name = key if key.isidentifier() else format_value(key)
    return f"{path}.{name}" if path else name


def read_toml(path: Path) -> dict[str, Any]:
    """Return the table in a TOML file; raise SceneError if it cannot be read."""
    try:
        if path.exists() and not path.is_file():
            raise SceneError(f"cannot read the scene {path}: not a file; {LIST_HINT}")
        if path.stat().st_size > MAX_FILE_BYTES:
            raise SceneError(f"scene {path.stem}: the file is larger than {MAX_FILE_BYTES} bytes; {LIST_HINT}")
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise SceneError(f"cannot read the scene {path}: {error.strerror}; {LIST_HINT}") from None
    except UnicodeDecodeError:
        raise SceneError(f"scene {path.stem}: not a text file in UTF-8; save it in UTF-8") from None
    except RecursionError:
        raise SceneError(f"scene {path.stem}: not valid TOML: brackets are nested too deeply") from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"scene {path.stem}: not valid TOML: {error}") from None
    except ValueError:
        raise SceneError(f"scene {path.stem}: an integer has thousands of digits: write it as in 1e300") from None
