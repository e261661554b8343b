"""The native FMU in a file: the same description, no Python inside, the same bytes for the same content.

modelDescription.xml
binaries/<platform>/<name>.{so,dll,dylib}
sources/                                  what they were made from, for any other platform
documentation/, model.png, extra/         page and licence, icon, certified result
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from xml.etree.ElementTree import SubElement, fromstring

from ...runtime.declare import Declaring
from .. import BuildError
from ..archive import build_date, licenses, write, zipped
from ..catalogue import find
from ..companions import companions
from ..description import declared_by, describe
from ..document import document
from ..modules import digest
from ..written import offer, written
from .compiler import PLATFORMS, USUAL, compiled
from .sources import COMPILED, build_description, guid_header, sources

LICENSE = "documentation/licenses/license.txt"


def build(
    model: str | Path,
    folder: Path,
    methods: Sequence[str] = (),
    laws: Sequence[str] = (),
    platforms: Sequence[str] = (),
) -> Path:
    """Write the FMU of a model, by name or path, for the platforms (none: the usual ones) into `folder`.

    An older one is replaced whole or not at all.  Methods and friction laws may be chosen, as for the Python FMU.
    """
    platforms = platforms or USUAL
    for platform in platforms:
        if platform not in PLATFORMS:
            raise BuildError(f"There is no platform {platform!r}; known are {', '.join(PLATFORMS)}.")
    date = build_date()
    source = find(model)
    name, cls = source.name, written(source, offer(source.model, source.name, methods, laws))
    files, description = frozen(cls, name, date)
    entries = companions(cls, source.path, declared_by(cls))
    entries |= {"modelDescription.xml": description, LICENSE: licenses()[LICENSE]}
    entries |= {f"sources/{file}": text.encode() for file, text in files.items()}
    entries["sources/buildDescription.xml"] = build_description(name)
    with ThreadPoolExecutor() as pool:
        binaries = pool.map(lambda platform: compiled(name, files, platform), platforms)
    for platform, content in zip(platforms, binaries, strict=True):
        entries[f"binaries/{platform}/{name}{PLATFORMS[platform].suffix}"] = content
    return write(folder / f"{name}.fmu", zipped(entries, date))


def frozen(model: type[Declaring], name: str, date: datetime) -> tuple[dict[str, str], bytes]:
    """The C sources of a model, and the description that goes with them."""
    files = sources(model)
    root = fromstring(describe(model, name, digest(files), date))
    interface = root.find("CoSimulation")
    assert interface is not None
    SubElement(SubElement(interface, "SourceFiles"), "File", name=COMPILED)
    files["guid.h"] = guid_header(root.attrib["guid"])
    return files, document(root)
