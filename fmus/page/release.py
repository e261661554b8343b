"""The release archive: everything that users without Python download, in one zip file with its checksums."""

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

from ..compiler import __version__
from ..compiler.model_lookup import find_model, model_names, more_model_names
from ..packaging.archive import build, build_date, license_files, write, zip_entries
from ..packaging.native.native_fmu import build as build_native
from . import FILE, MORE_FILE
from . import build as build_page

CHECKSUMS = "SHA256SUMS"
README = f"""\
friction-fmus {__version__}

FMUs of mechanical oscillators with dry friction.

fmus/              FMI 2.0 co-simulation; needs Python 3.9 to 3.13 in the simulation tool
fmus/native/       FMI 2.0 co-simulation and model exchange; needs nothing
fmus/native/fmi3/  FMI 3.0 co-simulation and model exchange; needs nothing
fmus/more/         the same three kinds of further models
web/index.html     the five models in a browser; works offline
web/more.html      the further models in a browser
references/        certified results of the default experiments (CSV)
licenses/          licences
{CHECKSUMS}         checksums; check them with: sha256sum --check {CHECKSUMS}
"""


def build_release(folder: Path, report: Callable[[str], None] = lambda file: None) -> Path:
    """Build every FMU of every kind and the live pages, and write them into one zip file.

    The archive has the same bytes for the same sources.

    Parameters
    ----------
    folder : Path
        Where to write ``friction-fmus-VERSION.zip``.
    report : callable, optional
        Takes the name of each file when its build begins.

    Returns
    -------
    Path
        The archive.

    Raises
    ------
    BuildError
        If an FMU cannot be built or the archive cannot be written.
    """
    entries = {f"licenses/{Path(path).name}": content for path, content in license_files().items()}
    entries["README.txt"] = README.encode()
    with TemporaryDirectory() as temporary:
        for group, names, page in (("fmus", model_names(), FILE), ("fmus/more", more_model_names(), MORE_FILE)):
            for name in names:
                source = find_model(name)
                kinds = {
                    group: lambda out, path=source.path: build(path, out),
                    f"{group}/native": lambda out, path=source.path: build_native(path, out),
                    f"{group}/native/fmi3": lambda out, path=source.path: build_native(path, out, fmi="3"),
                }
                for kind, make in kinds.items():
                    report(f"{kind}/{name}.fmu")
                    entries[f"{kind}/{name}.fmu"] = make(Path(temporary)).read_bytes()
                for file in sorted(source.path.parent.glob(f"{name}*.csv")):
                    entries[f"references/{file.name}"] = file.read_bytes()
            report(f"web/{page}")
            sources = [find_model(name) for name in names]
            entries[f"web/{page}"] = build_page(sources, Path(temporary), (), (), page).read_bytes()
    sums = "".join(f"{sha256(entries[path]).hexdigest()}  {path}\n" for path in sorted(entries))
    entries[CHECKSUMS] = sums.encode()
    root = f"friction-fmus-{__version__}"
    return write(
        folder / f"{root}.zip", zip_entries({f"{root}/{path}": entries[path] for path in entries}, build_date())
    )
