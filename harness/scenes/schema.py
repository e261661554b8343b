"""Validation of TOML files: converts a table to a dataclass, or reports the first error in one sentence.

The dataclass is the schema. Types carry constraints, as in `Annotated[float, POSITIVE]`. cattrs converts the table: its
errors include the keys of nested tables, which those of msgspec do not, and pydantic is about forty times larger. It is
imported with the first table that is read, because many commands read none and its import takes 40 ms.
"""

import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from itertools import pairwise
from math import isfinite
from pathlib import Path
from types import GenericAlias
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_origin

from ..errors import SceneError, format_value, unknown_name_message

if TYPE_CHECKING:
    from cattrs import Converter

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

Hook = Callable[[Any, Any], Any]


@cache
def converter() -> "Converter":
    """Return the converter from tables to dataclasses."""
    from cattrs import Converter

    hooks: tuple[tuple[Any, Any], ...] = (
        (is_dataclass, make_table_hook),
        (has_origin(dict), make_mapping_hook),
        (has_origin(Mapping), make_mapping_hook),
        (has_origin(tuple), make_list_hook),
        (find_constraint, make_value_hook),
    )
    result = Converter(forbid_extra_keys=True)
    for is_responsible, make_hook in hooks:
        result.register_structure_hook_factory(is_responsible, make_hook)
    return result


def find_constraint(annotation: Any) -> Constraint | None:
    """Return the constraint of an annotated type, or None."""
    return next((item for item in getattr(annotation, "__metadata__", ()) if isinstance(item, Constraint)), None)


def make_checked_hook(constraint: Constraint, convert: Hook) -> Hook:
    """Return a hook that checks a constraint before it converts."""

    def hook(value: Any, annotation: Any) -> Any:
        if not constraint.accepts(value):
            raise ValueError(f"{format_value(value)} is not {constraint.description}")
        return convert(value, annotation)

    return hook


def make_value_hook(annotation: Any) -> Hook:
    """Return a hook that keeps a value; a list becomes a tuple, and a text becomes a path if the type is a path."""
    constraint = find_constraint(annotation)
    assert constraint is not None
    if get_args(annotation)[0] is Path:
        return make_checked_hook(constraint, lambda value, _: Path(value))
    return make_checked_hook(constraint, lambda value, _: tuple(value) if isinstance(value, list) else value)


def make_table_hook(annotation: Any) -> Hook:
    """Return a hook for a table whose keys are the fields of a dataclass; the field `from_` holds the key `from`."""
    from cattrs.gen import make_dict_structure_fn, override

    renamed: Any = {name: override(rename=name.rstrip("_")) for name in field_names(annotation) if name.endswith("_")}
    return make_checked_hook(TABLE, make_dict_structure_fn(annotation, converter(), **renamed))


def field_names(schema: Any) -> list[str]:
    """Return the names of the fields of a dataclass."""
    return [field.name for field in fields(schema)]


def make_mapping_hook(annotation: Any) -> Hook:
    """Return a hook for a table with arbitrary keys and values of one type."""
    from cattrs.gen import make_mapping_structure_fn

    table_type: Any = GenericAlias(dict, get_args(annotation))
    return make_checked_hook(TABLE, make_mapping_structure_fn(table_type, converter()))


def make_list_hook(annotation: Any) -> Hook:
    """Return a hook for a list with items of one type."""
    list_type: Any = GenericAlias(list, get_args(annotation)[:1])
    return make_checked_hook(LIST, lambda value, _: tuple(converter().structure(value, list_type)))


def has_origin(container: Any) -> Callable[[Any], bool]:
    """Return a predicate for generic types of a container."""
    return lambda annotation: get_origin(annotation) is container


def parse_table(table: dict[str, Any], schema: type[Schema]) -> Schema:
    """Convert a table to its schema; raise SceneError with the most helpful error if it does not fit."""
    from cattrs.errors import BaseValidationError

    try:
        return converter().structure(table, schema)
    except BaseValidationError as error:
        raise SceneError(min(find_faults(error))[1]) from None


def find_faults(error: Exception, path: str = "") -> Iterator[tuple[int, str]]:
    """Yield (rank, message) for each error in a table; rank 0, an unknown key, is the most helpful."""
    from cattrs.errors import (
        ClassValidationError,
        ForbiddenExtraKeysError,
        IterableValidationError,
        IterableValidationNote,
    )

    if isinstance(error, ClassValidationError | IterableValidationError):
        with_notes, without_notes = error.group_exceptions()
        for nested, note in with_notes:
            key = note.index if isinstance(note, IterableValidationNote) else note.name.rstrip("_")
            yield from find_faults(nested, join_key_path(path, key))
        for nested in without_notes:
            yield from find_faults(nested, path)
    elif isinstance(error, ForbiddenExtraKeysError):
        allowed = [name.rstrip("_") for name in field_names(error.cl)]
        yield 0, unknown_name_message(f"key in [{path}]" if path else "key", min(error.extra_fields), allowed)
    elif isinstance(error, KeyError):
        yield 2, f"the key '{path}' is missing"
    else:
        yield 1, f"{path} = {error}"


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
