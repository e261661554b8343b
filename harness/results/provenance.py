"""Where a result came from: a file in its folder that names what was run, with which values, by which versions."""

import json
import platform
import shlex
import sys
from collections.abc import Iterable, Mapping
from datetime import datetime
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from .files import as_text

FILE = "provenance.json"
HARNESS = "friction-fmus"
PACKAGES = (HARNESS, "fmpy", "numpy", "scipy")

Parameters = Mapping[str, tuple[object, str]]  # by name: the value in force, and its unit


def record(
    folder: Path, files: Iterable[Path], parameters: Parameters | None = None, scene: object = None, name: str = FILE
) -> None:
    """Write into a folder of results where they come from: the digests of the `files` that were read, FMUs and
    records, all `parameters` in force, and the `scene` as it was run."""
    told = {
        "command": shlex.join(["python", "-m", "harness", *sys.argv[1:]]),
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "versions": {"python": platform.python_version(), **{package: installed(package) for package in PACKAGES}},
        "platform": platform.platform(),
        "files": {str(file): sha256(file.read_bytes()).hexdigest() for file in files if file.is_file()},
        "parameters": {name: {"value": value, "unit": unit} for name, (value, unit) in (parameters or {}).items()},
        "scene": scene,
    }
    (folder / name).write_text(as_text(told) + "\n", encoding="utf-8")


def installed(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def sentences(file: Path) -> tuple[str, ...]:
    """What a reader of the results wants to know of such a file, if it is there; ValueError, KeyError or TypeError if
    it holds something else."""
    if not file.is_file():
        return ()
    told = json.loads(file.read_text(encoding="utf-8"))
    files = [f"{Path(name).name} (sha256 {digest[:12]})" for name, digest in told["files"].items()]
    versions = told["versions"]
    made = f"harness {versions[HARNESS]}, fmpy {versions['fmpy']}, Python {versions['python']}, {told['platform']}"
    origin = f"Made from {', '.join(files) or 'no file'} by {made}, on {told['date'][:10]}: {told['command']}"
    values = [worded(name, **each) for name, each in told["parameters"].items()]
    return (origin, f"Parameters: {', '.join(values)}.") if values else (origin,)


def worded(name: str, value: object, unit: str) -> str:
    return f"{name} = {value} {unit}" if unit not in ("", "1") else f"{name} = {value}"
