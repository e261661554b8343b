"""Collects the source files that an FMU embeds: those that a model reaches through its imports.

They form one package that needs only the standard library.  The required part of pythonfmu is embedded as
`<package>/pythonfmu`, so the FMU never uses a pythonfmu installed in its host.
"""

import ast
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path, PurePosixPath

from . import BuildError
from .equations.model_file import ModelFile
from .model_lookup import FMUS
from .syntax_trees import parsed_module

ROOT, PYTHONFMU_ROOT = "__init__.py", "pythonfmu/__init__.py"  # replaced by generated or empty files
SLAVE = "runtime/slave.py"  # embedded with every model
INIT_SOURCE = '''\
"""{name} as an FMI 2.0 co-simulation slave."""

from .{name} import {model} as Model
from .runtime.pythonfmu_workarounds import keep_reference
from .runtime.slave import make_slave_class

{model} = make_slave_class(Model)
'''


@cache
def installed_package(package: str) -> Path:
    """Return the folder of an installed package without importing it."""
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise BuildError(f"{package} is not installed, and FMUs include a part of it: run 'pip install {package}'.")
    return Path(spec.origin).parent


def embedded_files(source: ModelFile, texts: Mapping[str, str], root: Path = FMUS) -> dict[str, str]:
    """Return the text of the model and of every file that it imports, by path in the package.

    Files are taken from `texts` if they are there, else from `root`.
    """
    files = {ROOT: INIT_SOURCE.format(name=source.name, model=source.class_name)}
    pending_paths = [f"{source.name}.py", SLAVE]
    for path in pending_paths:  # the list grows during the loop
        if path == PYTHONFMU_ROOT:
            files[path] = ""
        elif path not in files:
            text = texts[path] if path in texts else _on_disk(path, root).read_text(encoding="utf-8")
            files[path], imports = _embed(path, text, root)
            pending_paths += imports
    return files


def digest(files: dict[str, str], first: str = "") -> str:
    """Return the SHA-256 digest of `first` and all files, as 64 hexadecimal digits."""
    content = "".join(f"{path}\0{text}\0" for path, text in sorted(files.items()))
    return sha256((first + content).encode()).hexdigest()


def _on_disk(path: str, root: Path) -> Path:
    """Return the source file for a path in the package."""
    return installed_package("pythonfmu").parent / path if path.startswith("pythonfmu/") else root / path


def _embed(path: str, text: str, root: Path) -> tuple[str, list[str]]:
    """Return the text of a file as embedded, and the paths of the files that it imports, at the top of the file."""
    # Text mode converts line ends to "\n", so checkouts on all systems build the same bytes.
    lines = text.splitlines(keepends=True)
    parts = PurePosixPath(path).parts
    imports = ["/".join((*parts[:depth], "__init__.py")) for depth in range(1, len(parts))]
    for node in parsed_module("".join(lines)).body:
        if not isinstance(node, ast.ImportFrom):
            continue
        base = tuple(node.module.split(".")) if node.module else ()
        if node.level:
            base = (*parts[: len(parts) - node.level], *base)
        elif base[0] == "pythonfmu":
            dots = "." * len(parts)
            lines[node.lineno - 1] = lines[node.lineno - 1].replace("from pythonfmu", f"from {dots}pythonfmu", 1)
        else:
            continue  # of the standard library; the import contracts allow no other
        imports += [_resolve(path, base, alias.name, root) for alias in node.names]
    return "".join(lines), imports


def _resolve(path: str, base: tuple[str, ...], name: str, root: Path) -> str:
    """Return the file that `from base import name` reads: module `base.name`, or `base` if name is defined in it."""
    for parts in ((*base, name), base):
        for candidate in ("/".join(parts) + ".py", "/".join((*parts, "__init__.py"))):
            if candidate not in (ROOT, PYTHONFMU_ROOT) and _on_disk(candidate, root).is_file():
                return candidate
    raise BuildError(f"{path} imports {name} from {'.'.join(base) or 'the package itself'}, which FMUs do not include.")
