"""Writes the FMU archive with the file names of FMI; equal content gives equal bytes.

    modelDescription.xml
    binaries/<platform>/<name>.{so,dll}     native layer of pythonfmu
    resources/slavemodule.txt               names the entry script
    resources/<entry>.py                    imports the class (see runtime/pythonfmu_workarounds.py)
    resources/model_data.json               what the model description cannot state (model_data.py)
    resources/<package>/                    the model and the modules it needs (embedded_modules.py)
    documentation/                          page, licences, requirements on the host
    model.png                               icon
    extra/org.fmi-standard.fmi-ls-ref/      certified result (certified_result.py)

Python finds modules by bare name in the host process.  Package and entry script therefore carry a digest of their
content, so that two versions of an FMU can be loaded side by side.
"""

import os
from collections.abc import Sequence
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from stat import S_IFREG
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from ..compiler import BuildError, __date__
from ..compiler.embedded_modules import digest, embedded_files, installed_package
from ..compiler.lowering import lowered_files, lowered_model, select_features
from ..compiler.model_lookup import find_model
from .extra_files import extra_files
from .fmi_variables import declared_variables
from .model_description import describe

HOST_REQUIREMENTS = """\
CPython 3.9 or newer, 64 bit, with its standard library; no other packages.

Linux     libpython3 must be loaded in the process: start hosts other than Python with it in LD_PRELOAD.
Windows   the folder of python3.dll must be in PATH.
"""
USAGE_NOTE = """\
<p>This FMU contains Python code. A host that is not Python must have the
<a href='externalDependencies.txt'>Python library</a> in its process, or it cannot load the FMU. The native FMU of the
same model needs nothing.</p>
<p>A step that is refused or fails returns Discard, because the native layer of PythonFMU cannot return Error. A wrong
setting is refused by the next step. Hosts that check for Error only, such as fmusim, the FMU Compliance Checker and
PyFMI, end such a run as if it had succeeded: use the native FMU in them.</p>
"""
PYTHONFMU = "pythonfmu"
ENTRY_SCRIPT = """\
from {package} import {model}, keep_reference

keep_reference(globals())
"""
EARLIEST, LATEST = datetime(1980, 1, 1, tzinfo=UTC), datetime(2107, 12, 31, tzinfo=UTC)  # range of dates in a zip file


def build(
    model: str | Path,
    folder: Path,
    methods: Sequence[str] = (),
    laws: Sequence[str] = (),
    platforms: Sequence[str] = (),
    real_only: bool = False,
) -> Path:
    """Write the Python FMU of a model into `folder` and return its path.

    Parameters
    ----------
    model
        Name of a model of the project, or path of a model file.
    folder
        Output folder; an existing FMU is replaced atomically.
    methods, laws
        Integration methods and friction laws to include; by default all that the model has.
    platforms
        FMI platform names to include; by default all that pythonfmu provides.
    real_only
        Whether all variables are Reals, with one method and one law, for hosts without other types.
    """
    source, date = find_model(model), build_date()
    name, features = source.name, select_features(source, methods, laws, real_only)
    cls, texts = lowered_model(source, features), lowered_files(source, features)
    sources = embedded_files(source, texts)
    code = digest(sources, ENTRY_SCRIPT)
    package = f"{name}_{code[:12]}"
    entries = extra_files(cls, source.path, declared_variables(cls), source.analysis, use=USAGE_NOTE)
    entries |= {f"resources/{package}/{path}": text.encode() for path, text in sources.items()}
    entries |= {
        "documentation/externalDependencies.txt": HOST_REQUIREMENTS.encode(),
        "modelDescription.xml": describe(cls, name, code, date),
        "resources/slavemodule.txt": f"{package}_fmu".encode(),
        f"resources/{package}_fmu.py": ENTRY_SCRIPT.format(package=package, model=cls.__name__).encode(),
    }
    entries |= _binaries(name, platforms) | license_files()
    return write(folder / f"{name}.fmu", zip_entries(entries, date))


def build_date() -> datetime:
    """Return the build date: SOURCE_DATE_EPOCH (https://reproducible-builds.org), or the date of this version."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if epoch is None:
        return datetime.fromisoformat(__date__).replace(tzinfo=UTC)
    latest = int(LATEST.timestamp())
    if not (epoch.isascii() and epoch.isdigit() and int(epoch) <= latest):
        raise BuildError(f"SOURCE_DATE_EPOCH must be a whole number of seconds from 0 to {latest}, got {epoch!r}.")
    return max(EARLIEST, datetime.fromtimestamp(int(epoch), UTC))


def _binaries(name: str, platforms: Sequence[str]) -> dict[str, bytes]:
    """Return the native layer of pythonfmu for the given platforms, by default for all."""
    files = (installed_package(PYTHONFMU) / "resources" / "binaries").glob("*/*")
    libraries = {path.parent.name: path for path in sorted(files) if path.suffix in (".so", ".dll", ".dylib")}
    if not libraries:
        raise BuildError(f"The installed {PYTHONFMU} has no binaries: try 'pip install --force-reinstall {PYTHONFMU}'.")
    for platform in platforms:
        if platform not in libraries:
            raise BuildError(
                f"{PYTHONFMU} has no binary for {platform!r}: choose from {', '.join(libraries)}; --native has other "
                "platforms."
            )
    selection = [libraries[platform] for platform in platforms or libraries]
    return {f"binaries/{path.parent.name}/{name}{path.suffix}": path.read_bytes() for path in selection}


def license_files() -> dict[str, bytes]:
    """Return the licences of this project and of pythonfmu, by path in the FMU."""
    project_folder, license_pattern = Path(__file__).resolve().parents[2], "{}-*.dist-info/**/LICENSE"
    return {
        "documentation/licenses/license.txt": _license(
            project_folder, license_pattern.format("friction_fmus"), "LICENSE"
        ),  # the last pattern is for a clone
        f"documentation/licenses/{PYTHONFMU}.txt": _license(
            installed_package(PYTHONFMU).parent, license_pattern.format(PYTHONFMU)
        ),
    }


def _license(folder: Path, *patterns: str) -> bytes:
    """Return the last file that matches the first pattern with a match."""
    for pattern in patterns:
        for path in sorted(folder.glob(pattern), reverse=True):
            return path.read_text(encoding="utf-8").encode()
    raise BuildError(f"{patterns[-1]} is missing in {folder}, and every FMU includes it: restore it.")


def zip_entries(entries: dict[str, bytes], date: datetime) -> bytes:
    """Return a zip archive of the entries; order, times, permissions and compression do not depend on the machine."""
    buffer = BytesIO()
    with ZipFile(buffer, "w") as archive:
        for path in sorted(entries):
            info = ZipInfo(path, date.timetuple()[:6])
            info.compress_type, info.create_system = ZIP_DEFLATED, 3  # 3 is Unix, where permissions are honoured
            info.external_attr = (S_IFREG | (0o755 if path.startswith("binaries/") else 0o644)) << 16
            archive.writestr(info, entries[path])
    return buffer.getvalue()


def write(path: Path, content: bytes) -> Path:
    """Write a file atomically; no temporary file remains."""
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
