"""Provenance of a result: a file in its folder with the command, versions, input files and parameters.

The file may be damaged or edited. It is validated like any other input. A new result never depends on the provenance of
an old one, and the `command` in it is only displayed, never run.
"""

import json
import platform
import shlex
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any

from ..arguments import Rule, text
from ..errors import SceneError
from ..scenes.schema import field_names, parse_table
from .files import to_json

FILE = "provenance.json"
HARNESS = "friction-fmus"
REPLACEMENT_KEY = "replaced"
# options of a result that follow from its parameters or input files
IMPLIED_OPTIONS = {"values", "name", "fmu", "file", "source", "equal_steps"}
KNOWN_VALUES = {"published", "reference", "parameter", "citation", "remark"}  # of a scene; they do not change its run
PACKAGES = (HARNESS, "fmpy", "numpy", "scipy")
MAX_DEPTH = 6  # of tables and lists within a scene

Parameters = Mapping[str, tuple[object, str]]  # effective value and unit by name


def is_shallow(value: object, depth: int = MAX_DEPTH) -> bool:
    """Return whether tables and lists are nested in at most `depth` levels."""
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return items is None or (depth > 0 and all(is_shallow(item, depth - 1) for item in items))


def digest(value: Any) -> str:
    """Return a SHA-256 digest in hexadecimal digits."""
    if len(value) != 64:
        raise ValueError
    return text(value)


def value_or_list(value: Any) -> Any:
    """Return a value or a list with few levels."""
    if isinstance(value, dict) or not is_shallow(value, 3):
        raise ValueError
    return value


def settings(value: Any) -> dict[str, Any] | None:
    """Return a table with few levels, or None."""
    if not isinstance(value, dict | None) or not is_shallow(value):
        raise ValueError
    return value


DIGEST = Rule("a SHA-256 digest", digest)
VALUE = Rule("a value", value_or_list)
SETTINGS = Rule("a table, or null", settings)


@dataclass(frozen=True)
class StoredParameter:
    """Effective value and unit of a parameter."""

    value: Annotated[Any, VALUE]
    unit: str


@dataclass(frozen=True)
class ProvenanceKeys:
    """Keys of a provenance file."""

    command: str
    date: str
    files: dict[str, Annotated[str, DIGEST]]
    parameters: dict[str, StoredParameter]
    scene: Annotated[Any, SETTINGS]
    source: str = ""
    platform: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    run: Annotated[Any, SETTINGS] = None
    replaced: str = ""


def write_provenance(
    folder: Path,
    files: Iterable[Path],
    parameters: Parameters | None = None,
    scene: object = None,
    source: str = "",
    command: str | None = None,
    run: object = None,
) -> None:
    """Write the provenance of a result.

    Parameters
    ----------
    folder : pathlib.Path
        Result folder.
    files : iterable of pathlib.Path
        FMUs and records that were read; their digests are stored.
    parameters : mapping, optional
        Effective value and unit by name.
    scene : object, optional
        Analyses and plots of a scene, or options of a study.
    source : str
        Source of the result, as given on the command line.
    command : str, optional
        Text to record for a result that no command wrote; by default the command line of this process.
    run : RunSpec, optional
        Effective settings of the run.
    """
    content = {
        "source": source,
        "command": shlex.join(["python", "-m", "harness", *sys.argv[1:]]) if command is None else command,
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "versions": package_versions(),
        "platform": platform.platform(),
        "files": {str(file): file_digest(file) for file in files if file.is_file()},
        "parameters": {name: {"value": value, "unit": unit} for name, (value, unit) in (parameters or {}).items()},
        "run": run,
        "scene": scene,
    }
    (folder / FILE).write_text(to_json(content) + "\n", encoding="utf-8")


def prefix_parameters(parts: Mapping[str, Parameters]) -> Parameters:
    """Return the parameters of several parts, prefixed with the part's name."""
    return {
        f"{part}: {name}": parameter for part, parameters in parts.items() for name, parameter in parameters.items()
    }


def describe_sources(*sources: str) -> str:
    """Return sources for the provenance: absolute paths of existing files, other names unchanged."""
    return ", ".join(str(Path(source).resolve()) if Path(source).exists() else source for source in sources)


def file_digest(file: Path) -> str:
    """Return the SHA-256 digest of a file."""
    return sha256(file.read_bytes()).hexdigest()


def package_versions() -> dict[str, str]:
    """Return the versions of the harness and of the packages that determine its numbers."""
    return {package: package_version(package) for package in PACKAGES} | {"python": platform.python_version()}


@cache
def package_version(package: str) -> str:
    """Return the version of an installed package."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def load_provenance(folder: Path) -> dict[str, Any]:
    """Return the provenance of a result; empty if there is none or it is not valid."""
    try:
        return read_provenance(folder / FILE)
    except (OSError, SceneError):
        return {}


def read_provenance(file: Path) -> dict[str, Any]:
    """Read a provenance file, validate its keys and return those that are known.

    Raises
    ------
    OSError
        If the file cannot be read.
    SceneError
        If a value is not valid, or a required key is missing.
    """
    content = {name: value for name, value in read_table(file).items() if name in field_names(ProvenanceKeys)}
    parse_table(content, ProvenanceKeys)
    return content


def read_table(file: Path) -> dict[str, Any]:
    """Return the table in a JSON file; raise OSError or SceneError if there is none."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        raise SceneError("it is not JSON") from None
    if not isinstance(content, dict):
        raise SceneError("it is not a table")
    return content


def note_replaced_result(old_folder: Path, new_folder: Path, file: str) -> None:
    """Add a note to the provenance of a new result about the old one that it replaces.

    The note lists the settings in which they differ. If there are none, the note of a run states whether the first
    result file is identical. There is no note about an old file that is not valid.
    """
    before = load_provenance(old_folder)
    after = load_provenance(new_folder) if before else {}
    if not after:
        return
    differences = [
        format_parameter(name, **parameter)
        for name, parameter in before["parameters"].items()
        if parameter != after["parameters"].get(name)
    ]
    options, new_options = (
        {name: value for name, value in settings.items() if name not in KNOWN_VALUES}
        for settings in ((item.get("run") or {}) | (item["scene"] or {}) for item in (before, after))
    )
    unchanged_names = [name for name in options if name in IMPLIED_OPTIONS or options[name] == new_options.get(name)]
    differences += [format_option(name, value) for name, value in options.items() if name not in unchanged_names]
    differences += [f"another {name}" for name, value in before["files"].items() if value != after["files"].get(name)]
    if differences:
        sentence = f"It replaces the result of {before['date']}, which had {', '.join(sorted(differences))}."
    elif options:
        is_identical = (old_folder / file).is_file() and file_digest(old_folder / file) == file_digest(
            new_folder / file
        )
        comparison = "the same, bit for bit" if is_identical else "not the same bit for bit"
        sentence = f"The result of {before['date']} was {comparison}."
    else:
        return
    (new_folder / FILE).write_text(to_json(after | {REPLACEMENT_KEY: sentence}) + "\n", encoding="utf-8")


def format_option(name: str, value: object) -> str:
    """Return the setting of an option in words."""
    return name if value is True else f"{name} = {value}" if value else f"no {name}"


def replacement_note(folder: Path) -> str:
    """Return the note about the replaced result; empty if there was none."""
    try:
        return str(read_table(folder / FILE).get(REPLACEMENT_KEY, ""))
    except (OSError, SceneError):
        return ""


def describe_origin(content: dict[str, Any]) -> tuple[str, ...]:
    """Return sentences about the origin of a result, from the content of its provenance."""
    files = [f"{Path(name).name} (sha256 {digest[:12]})" for name, digest in content["files"].items()]
    versions = content["versions"]
    origin = (
        f"Made from {', '.join(files) or 'no file'} by harness {versions[HARNESS]}, fmpy {versions['fmpy']}, "
        f"Python {versions['python']}, {content['platform']}, on {content['date'][:10]}: {content['command']}"
    )
    values = [format_parameter(name, **parameter) for name, parameter in content["parameters"].items()]
    return (origin, f"Parameters: {', '.join(values)}.") if values else (origin,)


def format_parameter(name: str, value: object, unit: str) -> str:
    """Return a parameter as "name = value unit"."""
    return f"{name} = {value} {unit}" if unit not in ("", "1") else f"{name} = {value}"
