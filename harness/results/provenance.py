"""Where a result came from: a file in its folder that names what was run, with which values, by which versions."""

import json
import platform
import shlex
import sys
from collections.abc import Iterable, Mapping
from datetime import datetime
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ..errors import HarnessError
from .files import to_json

FILE = "provenance.json"
HARNESS = "friction-fmus"
REPLACED = "replaced"
IMPLIED_SCENE_KEYS = {"values", "name", "file", "source"}  # of a scene: in its parameters, or in what it was made from
PACKAGES = (HARNESS, "fmpy", "numpy", "scipy")

Parameters = Mapping[str, tuple[object, str]]  # by name: the value in force, and its unit


def write_provenance(
    folder: Path,
    files: Iterable[Path],
    parameters: Parameters | None = None,
    scene: object = None,
    name: str = FILE,
    source: str = "",
    command: str | None = None,
) -> None:
    """Write into a folder of results where they come from: the digests of the `files` that were read, FMUs and
    records, all `parameters` in force, the `scene` as it was run, and the `source` that was named."""
    told = {
        "source": source,
        "command": shlex.join(["python", "-m", "harness", *sys.argv[1:]]) if command is None else command,
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "versions": package_versions(),
        "platform": platform.platform(),
        "files": {str(file): file_digest(file) for file in files if file.is_file()},
        "parameters": {name: {"value": value, "unit": unit} for name, (value, unit) in (parameters or {}).items()},
        "scene": scene,
    }
    (folder / name).write_text(to_json(told) + "\n", encoding="utf-8")


def prefix_parameters(parts: Mapping[str, Parameters]) -> Parameters:
    """The parameters of several parts, each by the name of its own before it."""
    return {f"{part}: {name}": told for part, each in parts.items() for name, told in each.items()}


def describe_sources(*sources: str) -> str:
    """What a result was made from, for its account: paths of what is there in full, other words as they are."""
    return ", ".join(str(Path(each).resolve()) if Path(each).exists() else each for each in sources)


def file_digest(file: Path) -> str:
    return sha256(file.read_bytes()).hexdigest()


def package_versions() -> dict[str, str]:
    """Of the harness, and of what its numbers hang on."""
    return {package: package_version(package) for package in PACKAGES} | {"python": platform.python_version()}


@cache
def package_version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def load_provenance(folder: Path, name: str = FILE) -> dict[str, Any]:
    """What a folder of results says of its origin; nothing where it does not."""
    try:
        told = json.loads((folder / name).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return told if isinstance(told, dict) and is_complete(told) else {}


def is_complete(told: dict[str, Any]) -> bool:
    """Whether all is there that others ask for."""
    texts = all(isinstance(told.get(name), str) for name in ("command", "date"))
    tables = all(isinstance(told.get(name), dict) for name in ("files", "parameters")) and "scene" in told
    return texts and tables and all(isinstance(each, dict) and len(each) == 2 for each in told["parameters"].values())


def note_replaced_result(older: Path, fresh: Path, file: str) -> None:
    """Let the account of a fresh result tell of the older one whose place it takes: what that was made with, if it was
    not the same; otherwise, of a scene, whether the file of both is the same."""
    before, after = load_provenance(older), load_provenance(fresh)
    if not before or not after:
        return
    had = [
        format_parameter(name, **each)
        for name, each in before["parameters"].items()
        if each != after["parameters"].get(name)
    ]
    scene, now = before["scene"] or {}, after["scene"] or {}
    kept = [name for name in scene if name in IMPLIED_SCENE_KEYS or scene[name] == now.get(name)]
    had += [format_option(name, value) for name, value in scene.items() if name not in kept]
    had += [f"another {name}" for name, told in before["files"].items() if told != after["files"].get(name)]
    if had:
        sentence = f"It takes the place of the result of {before['date']}, which had {', '.join(sorted(had))}."
    elif scene:
        same = (older / file).is_file() and file_digest(older / file) == file_digest(fresh / file)
        told = "the same, bit for bit" if same else "not the same to the last bit"
        sentence = f"The result of {before['date']} was {told}."
    else:
        return
    (fresh / FILE).write_text(to_json(after | {REPLACED: sentence}) + "\n", encoding="utf-8")


def format_option(name: str, value: object) -> str:
    """What was asked, in words."""
    return name if value is True else f"{name} = {value}" if value else f"no {name}"


def replacement_note(folder: Path) -> str:
    """What a result says of the one whose place it took; empty where there was none."""
    return str(load_provenance(folder).get(REPLACED, ""))


def load_verified_provenance(folder: Path) -> dict[str, Any]:
    """What a folder of results says of its origin; HarnessError if it says nothing, or if a file is not what it was."""
    told = load_provenance(folder)
    if not told:
        raise HarnessError(f"{folder} holds no result that tells what made it: name one with a whole {FILE}")
    for name, before in told["files"].items():
        file = Path(name)
        if not file.is_file():
            raise HarnessError(f"{file}, from which this was made, is not here: run from the folder where it is")
        if (now := file_digest(file)) != before:
            raise HarnessError(
                f"{file} has changed since this was made from it (sha256 {before[:12]} then, {now[:12]} now): put it "
                f"back, or make a new result with `{told['command']}`"
            )
    return told


def summarize_provenance(file: Path) -> tuple[str, ...]:
    """What a reader of the results wants to know of such a file, if it is there; ValueError, KeyError or TypeError if
    it holds something else."""
    if not file.is_file():
        return ()
    told = json.loads(file.read_text(encoding="utf-8"))
    files = [f"{Path(name).name} (sha256 {digest[:12]})" for name, digest in told["files"].items()]
    versions = told["versions"]
    made = f"harness {versions[HARNESS]}, fmpy {versions['fmpy']}, Python {versions['python']}, {told['platform']}"
    origin = f"Made from {', '.join(files) or 'no file'} by {made}, on {told['date'][:10]}: {told['command']}"
    values = [format_parameter(name, **each) for name, each in told["parameters"].items()]
    return (origin, f"Parameters: {', '.join(values)}.") if values else (origin,)


def format_parameter(name: str, value: object, unit: str) -> str:
    return f"{name} = {value} {unit}" if unit not in ("", "1") else f"{name} = {value}"
