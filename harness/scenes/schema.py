"""The one check of what people write: a table of TOML becomes a dataclass, or one sentence says where it is wrong.

The dataclass is the schema: keys, tables in tables, and beside each type, as in `Annotated[float, POSITIVE]`, what a
value must be and the words for that.  cattrs walks the table.  (It finds the place of what is wrong, tables by name
included; msgspec leaves such names out, and pydantic is some forty times its size.)
"""

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from math import isfinite
from pathlib import Path
from types import GenericAlias
from typing import Any, TypeVar, get_args, get_origin

from cattrs import Converter
from cattrs.errors import (
    BaseValidationError,
    ClassValidationError,
    ForbiddenExtraKeysError,
    IterableValidationError,
    IterableValidationNote,
)
from cattrs.gen import make_dict_structure_fn, make_mapping_structure_fn, override

from ..errors import SceneError, format_value, unknown_name_message

LIST_HINT = "`python -m harness list` shows the scenes that there are"
MAX_TITLE_LENGTH = 200  # letters
MAX_FILE_BYTES = 1_000_000  # bytes of a file that somebody wrote
Schema = TypeVar("Schema")


@dataclass(frozen=True)
class Constraint:
    """What a value must be, and the words for it."""

    accepts: Callable[[Any], bool]
    description: str


def is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value)


def is_title(value: object) -> bool:
    text = str(value)
    return is_text(value) and len(text) <= MAX_TITLE_LENGTH and text.splitlines() == [text] and "\0" not in text


def is_number(value: object) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False


def is_whole(value: object, least: float, most: float) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def is_names(value: object) -> bool:
    return isinstance(value, list) and all(map(is_text, value)) and len(set(value)) == len(value)


TITLE = Constraint(is_title, f"a text of one line and at most {MAX_TITLE_LENGTH} letters")
TEXT = Constraint(is_text, "a text")
NUMBER = Constraint(is_number, "a finite number")
POSITIVE = Constraint(lambda value: is_number(value) and value > 0, "a finite number above 0")
NAMES = Constraint(is_names, "a list of different names")
FLAG = Constraint(lambda value: isinstance(value, bool), "true or false")
TABLE = Constraint(lambda value: isinstance(value, dict), "a table")
LIST = Constraint(lambda value: isinstance(value, list), "a list")

Hook = Callable[[Any, Any], Any]
CONVERTER = Converter(forbid_extra_keys=True)


def find_constraint(annotation: Any) -> Constraint | None:
    """The kind that stands beside a type."""
    return next((each for each in getattr(annotation, "__metadata__", ()) if isinstance(each, Constraint)), None)


def make_checked_hook(kind: Constraint, then: Hook) -> Hook:
    """What refuses a value that is not of its kind, and goes on with one that is."""

    def hook(value: Any, annotation: Any) -> Any:
        if not kind.accepts(value):
            raise ValueError(f"{format_value(value)} is not {kind.description}")
        return then(value, annotation)

    return hook


def make_value_hook(annotation: Any) -> Hook:
    """A value stays as it is; a list, which could be changed, becomes a tuple."""
    kind = find_constraint(annotation)
    assert kind is not None
    return make_checked_hook(kind, lambda value, _: tuple(value) if isinstance(value, list) else value)


def make_table_hook(annotation: Any) -> Hook:
    """A table whose keys are the fields of a dataclass; `from_` stands for the key `from`."""
    renamed: Any = {name: override(rename=name.rstrip("_")) for name in field_names(annotation) if name.endswith("_")}
    return make_checked_hook(TABLE, make_dict_structure_fn(annotation, CONVERTER, **renamed))


def field_names(schema: Any) -> list[str]:
    return [each.name for each in fields(schema)]


def make_mapping_hook(annotation: Any) -> Hook:
    """A table whose keys are free, and whose values are alike."""
    return make_checked_hook(TABLE, make_mapping_structure_fn(annotation, CONVERTER))


def make_list_hook(annotation: Any) -> Hook:
    """A list whose items are alike."""
    alike: Any = GenericAlias(list, get_args(annotation)[:1])
    return make_checked_hook(LIST, lambda value, _: tuple(CONVERTER.structure(value, alike)))


def has_origin(container: Any) -> Callable[[Any], bool]:
    return lambda annotation: get_origin(annotation) is container


for concerns, hooks in (
    (is_dataclass, make_table_hook),
    (has_origin(dict), make_mapping_hook),
    (has_origin(tuple), make_list_hook),
    (find_constraint, make_value_hook),
):
    CONVERTER.register_structure_hook_factory(concerns, hooks)  # type: ignore[arg-type]


def parse_table(written: dict[str, Any], schema: type[Schema]) -> Schema:
    """A table as its schema says; SceneError in one sentence if it does not fit."""
    try:
        return CONVERTER.structure(written, schema)
    except BaseValidationError as error:
        raise SceneError(min(find_faults(error))[1]) from None


def find_faults(error: Exception, where: str = "") -> Iterator[tuple[int, str]]:
    """What is wrong at a place and below it, a sentence each; a key that nobody knows explains most: rank 0."""
    if isinstance(error, ClassValidationError | IterableValidationError):
        placed, others = error.group_exceptions()
        for each, note in placed:
            key = note.index if isinstance(note, IterableValidationNote) else note.name.rstrip("_")
            yield from find_faults(each, join_key_path(where, key))
        for each in others:
            yield from find_faults(each, where)
    elif isinstance(error, ForbiddenExtraKeysError):
        allowed = [name.rstrip("_") for name in field_names(error.cl)]
        yield 0, unknown_name_message(f"key in [{where}]" if where else "key", min(error.extra_fields), allowed)
    elif isinstance(error, KeyError):
        yield 2, f"the key '{where}' is missing"
    else:
        yield 1, f"{where} = {error}"


def join_key_path(where: str, key: str | int) -> str:
    """The place of a key, or of an item counted from 0."""
    if isinstance(key, int):
        return f"{where}[{key}]"
    name = key if key.isidentifier() else format_value(key)
    return f"{where}.{name}" if where else name


def read_toml(path: Path) -> dict[str, Any]:
    """The table in a TOML file; SceneError in one sentence if there is none."""
    try:
        if path.exists() and not path.is_file():
            raise SceneError(f"cannot read the scene {path}: not a file; {LIST_HINT}")
        if path.stat().st_size > MAX_FILE_BYTES:
            raise SceneError(f"scene {path.stem}: more than {MAX_FILE_BYTES} bytes are no scene; {LIST_HINT}")
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise SceneError(f"cannot read the scene {path}: {error.strerror}; {LIST_HINT}") from None
    except UnicodeDecodeError:
        raise SceneError(f"scene {path.stem}: not a text file in UTF-8: save it as one") from None
    except RecursionError:
        raise SceneError(f"scene {path.stem}: not valid TOML: brackets too deep in each other") from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"scene {path.stem}: not valid TOML: {error}") from None
    except ValueError:
        raise SceneError(f"scene {path.stem}: an integer of thousands of digits: write it as in 1e300") from None
