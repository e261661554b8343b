"""The zip: binaries, sources and description under their FMI 2.0 names, the same bytes for the same content.

    modelDescription.xml
    binaries/<platform>/<name>.{so,dll}     the native layer of pythonfmu
    resources/slavemodule.txt               names the entry script
    resources/<entry>.py                    imports the class; runs for every instance (guard.py says why)
    resources/<package>/                    the model and what it needs (modules.py)
    documentation/                          the page (page.py) and licences
    model.png                               the icon
    extra/org.fmi-standard.fmi-ls-ref/      the certified result (reference.py)

Python finds modules by bare name in the process of the host.  So package and entry carry a digest of their
content, and two versions of an FMU live side by side.
"""

import os
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from stat import S_IFREG
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from . import BuildError
from .catalogue import load
from .companions import companions
from .description import declared_by, describe
from .lean import imported, offer, reduced
from .modules import pythonfmu_folder, travelling

ENTRY = """\
from {package} import {model}, hold

hold(globals())
"""
EARLIEST, LATEST = datetime(1980, 1, 1, tzinfo=UTC), datetime(2107, 12, 31, tzinfo=UTC)  # that a zip can tell


def build(
    name: str, folder: Path, methods: Sequence[str] = (), laws: Sequence[str] = (), platforms: Sequence[str] = ()
) -> Path:
    """Write `<name>.fmu` into `folder`; an older one is replaced whole or not at all.

    Methods, friction laws and platforms may be chosen (lean.py); without a choice it has all there are.
    """
    model, date = load(name), build_date()
    offered = offer(model, name, methods, laws)
    sources = travelling(name, edit=partial(reduced, offered=offered)) if offered else travelling(name)
    content = "".join(f"{path}\0{text}\0" for path, text in sorted(sources.items()))
    code = sha256((ENTRY + content).encode()).hexdigest()
    package = f"{name}_{code[:12]}"
    if offered:
        model = imported(sources, name, package)
    entries = companions(model, name, declared_by(model))
    entries |= {f"resources/{package}/{path}": text.encode() for path, text in sources.items()}
    entries |= {
        "modelDescription.xml": describe(model, name, code, date),
        "resources/slavemodule.txt": f"{package}_fmu".encode(),
        f"resources/{package}_fmu.py": ENTRY.format(package=package, model=model.__name__).encode(),
    }
    return write(folder / f"{name}.fmu", zipped(entries | _binaries(name, platforms) | licenses(), date))


def build_date() -> datetime:
    """The date that the FMU tells: SOURCE_DATE_EPOCH (https://reproducible-builds.org), or always the same."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "0")
    latest = int(LATEST.timestamp())
    if not (epoch.isascii() and epoch.isdigit() and int(epoch) <= latest):
        raise BuildError(f"SOURCE_DATE_EPOCH is {epoch!r}; allowed are whole seconds from 0 to {latest}.")
    return max(EARLIEST, datetime.fromtimestamp(int(epoch), UTC))


def _binaries(name: str, platforms: Sequence[str]) -> dict[str, bytes]:
    """The native layer for the platforms, or for every one that pythonfmu comes with."""
    folder = pythonfmu_folder() / "resources" / "binaries"
    found = [path for path in folder.glob("*/*") if path.suffix in (".so", ".dll", ".dylib")]
    if not found:
        raise BuildError("The installed pythonfmu has no binaries: try 'pip install --force-reinstall pythonfmu'.")
    there = sorted({path.parent.name for path in found})
    for platform in platforms:
        if platform not in there:
            raise BuildError(f"pythonfmu has no binary for {platform}, only for {', '.join(there)}: add --native.")
    chosen = [path for path in found if path.parent.name in (platforms or there)]
    return {f"binaries/{path.parent.name}/{name}{path.suffix}": path.read_bytes() for path in chosen}


def licenses() -> dict[str, bytes]:
    """The licence of the FMU, and that of the part of pythonfmu inside it."""
    texts = {}
    for path, folder, pattern in (
        ("license.txt", Path(__file__).resolve().parents[2], "LICENSE"),
        ("pythonfmu.txt", pythonfmu_folder().parent, "pythonfmu-*.dist-info/**/LICENSE"),
    ):
        found = sorted(folder.glob(pattern))
        if not found:
            raise BuildError(f"There is no {pattern} in {folder}, and an FMU carries it: restore it.")
        texts[f"documentation/licenses/{path}"] = found[-1].read_text(encoding="utf-8").encode()
    return texts


def zipped(entries: dict[str, bytes], date: datetime) -> bytes:
    """A zip of the entries; order, time, permissions and compression do not depend on the machine."""
    buffer = BytesIO()
    with ZipFile(buffer, "w") as archive:
        for path in sorted(entries):
            info = ZipInfo(path, date.timetuple()[:6])
            info.compress_type, info.create_system = ZIP_DEFLATED, 3  # 3 is Unix: only there permissions count
            info.external_attr = (S_IFREG | (0o755 if path.startswith("binaries/") else 0o644)) << 16
            archive.writestr(info, entries[path], compresslevel=9)
    return buffer.getvalue()


def write(path: Path, content: bytes) -> Path:
    """Put the file in its place in one move; nothing else is left behind."""
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_bytes(content)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise BuildError(f"Cannot write {path}: {error.strerror}; try another folder with --out.") from error
    return path
