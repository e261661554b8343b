"""Validation of TOML files: converts a table to a dataclass, or reports the first error in one sentence.

The dataclass is the schema. Types may carry a rule of `harness.arguments`, as in `Annotated[float, POSITIVE]`.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import NoneType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from ..arguments import FINITE, FLAG, NATURAL, PATH, Rule, text
from ..errors import SceneError, format_value, unknown_name_message

LIST_HINT = "`friction-fmus info` lists the available scenes"
MAX_TITLE_LENGTH = 200  # letters
MAX_FILE_BYTES = 1_000_000  # bytes
Schema = TypeVar("Schema")


def as_title(value: Any) -> str:
    """Return a text of a single line and of limited length."""
    if len(text(value)) > MAX_TITLE_LENGTH or value.splitlines() != [value]:
        raise ValueError
    return str(value)


def as_string(value: Any) -> str:
    """Return a text, which may be empty."""
    if not isinstance(value, str):
        raise TypeError
    return value


def as_table(value: Any) -> dict[str, Any]:
    """Return a table."""
    if not isinstance(value, dict):
        raise TypeError
    return value


def as_list(value: Any) -> list[Any]:
    """Return a list."""
    if not isinstance(value, list):
        raise TypeError
    return value


def as_path(value: Any) -> Path:
    """Return a path."""
    return Path(PATH.convert(value))


TITLE = Rule(f"a text of one line and at most {MAX_TITLE_LENGTH} characters", as_title)
STRING = Rule("a text", as_string)
TABLE = Rule("a table", as_table)
LIST = Rule("a list", as_list)
FILE_PATH = Rule("a path", as_path)
PLAIN = {str: STRING, bool: FLAG, int: NATURAL, float: FINITE, Path: FILE_PATH}  # rules of types that state none

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
    origin, arguments = get_origin(annotation), get_args(annotation)
    if NoneType in arguments:
        (value_type,) = (item for item in arguments if item is not NoneType)
        return None if value is None else convert(value, value_type, path, faults)
    try:
        value = find_rule(annotation).check(path, value)
    except SceneError as error:
        faults.append((1, str(error)))
        return None
    if is_dataclass(annotation):
        return convert_table(value, annotation, path, faults)
    if origin in (dict, Mapping):
        return {key: convert(item, arguments[1], join_key_path(path, key), faults) for key, item in value.items()}
    if origin is tuple:
        return tuple(convert(item, arguments[0], join_key_path(path, i), faults) for i, item in enumerate(value))
    return value


def convert_table(table: Mapping[str, Any], schema: Any, path: str, faults: Faults) -> Any:
    """Return a table whose keys are the fields of a dataclass."""
    n_faults = len(faults)
    names = field_names(schema)
    if unknown_keys := table.keys() - set(names):
        faults.append((0, unknown_name_message(f"key in [{path}]" if path else "key", min(unknown_keys), names)))
    required_keys = {
        field.name for field in fields(schema) if field.default is MISSING and field.default_factory is MISSING
    }
    faults += [
        (2, f"the key '{join_key_path(path, key)}' is missing")
        for key in names
        if key in required_keys and key not in table
    ]
    types = type_hints(schema)
    values = {key: convert(table[key], types[key], join_key_path(path, key), faults) for key in names if key in table}
    if len(faults) > n_faults:
        return None
    try:
        return schema(**values)
    except ValueError as error:
        faults.append((1, f"{path}: {error}" if path else str(error)))


@cache
def type_hints(schema: Any) -> dict[str, Any]:
    """Return the annotated types of the fields of a dataclass."""
    return get_type_hints(schema, include_extras=True)


def find_rule(annotation: Any) -> Rule:
    """Return the rule that annotates a type, or that follows from it; an optional type has that of its values."""
    if rules := [item for item in getattr(annotation, "__metadata__", ()) if isinstance(item, Rule)]:
        return rules[0]
    origin, arguments = get_origin(annotation), get_args(annotation)
    if NoneType in arguments:
        (value_type,) = (item for item in arguments if item is not NoneType)
        return find_rule(value_type)
    if is_dataclass(annotation) or origin in (dict, Mapping):
        return TABLE
    return LIST if origin is tuple else PLAIN[annotation]


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
