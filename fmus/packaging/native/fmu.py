"""The native FMU in a file: the same description, no Python inside, the same bytes for the same content.

modelDescription.xml
binaries/<platform>/<name>.{so,dll,dylib}
sources/                                  what they were made from, for any other platform
documentation/, extra/                    page and licence, certified result
model.png                                 the icon; FMI 3.0: terminalsAndIcons/, with the flange
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from xml.etree.ElementTree import SubElement, fromstring

from ...runtime.variable_declarations import VariableOwner
from .. import BuildError
from ..archive import build_date, license_files, write, zip_entries
from ..embedded_modules import digest
from ..extra_files import extra_files
from ..lowering import lowered_model, select_features
from ..model_description import declared_variables, describe
from ..model_description_fmi3 import describe as describe3
from ..model_lookup import find_model
from ..terminals import terminals
from ..xml_output import xml_bytes
from .compiler import DEFAULT_PLATFORMS, PLATFORMS, compile_binaries
from .sources import MAIN_SOURCE, collect_sources, render_build_description, render_guid_header

LICENSE = "documentation/licenses/license.txt"
ICON_PATHS = {"2": "model.png", "3": "terminalsAndIcons/icon.png"}
USAGE_NOTE = """\
<p>In model exchange the importer's solver takes the place of ours, and <code>solver.*</code> says nothing; where
friction is dry, the mode changes at events, which the importer finds by <code>events.to_rest</code> and
<code>events.to_break_away</code>. In FMI 3.0 co-simulation, too, it may handle events itself: a step returns early at
stick and slip.</p>
"""


def build(
    model: str | Path,
    folder: Path,
    methods: Sequence[str] = (),
    laws: Sequence[str] = (),
    platforms: Sequence[str] = (),
    fmi: str = "2",
) -> Path:
    """Write the FMU of a model, by name or path, for the platforms (none: the usual ones) and a version of FMI, into
    `folder`.

    An older one is replaced whole or not at all.  Methods and friction laws may be chosen, as for the Python FMU.
    """
    platforms = platforms or DEFAULT_PLATFORMS
    for platform in platforms:
        if platform not in PLATFORMS:
            raise BuildError(f"There is no platform {platform!r}; known are {', '.join(PLATFORMS)}.")
    date = build_date()
    source = replace(find_model(model), ramps=fmi == "2")  # FMI 3.0 has no derivatives of inputs
    name, cls = source.name, lowered_model(source, select_features(source, methods, laws))
    files, description = generate_c_sources(cls, name, date, fmi)
    declared = declared_variables(cls)
    entries = extra_files(cls, source.path, declared, ICON_PATHS[fmi], USAGE_NOTE)
    if fmi == "3":
        entries |= terminals(declared)
    entries |= {"modelDescription.xml": description, LICENSE: license_files()[LICENSE]}
    entries |= {f"sources/{file}": text.encode() for file, text in files.items()}
    entries["sources/buildDescription.xml"] = render_build_description(name, fmi)
    with ThreadPoolExecutor() as pool:
        for content in pool.map(
            lambda platform: compile_binaries(name, files, MAIN_SOURCE[fmi], platform, fmi), platforms
        ):
            entries |= content
    return write(folder / f"{name}.fmu", zip_entries(entries, date))


def generate_c_sources(model: type[VariableOwner], name: str, date: datetime, fmi: str) -> tuple[dict[str, str], bytes]:
    """The C sources of a model, and the description that goes with them."""
    files = collect_sources(model, fmi)
    if fmi == "3":
        root = fromstring(describe3(model, name, digest(files), date))
        files["guid.h"] = render_guid_header(root.attrib["instantiationToken"])
        return files, xml_bytes(root)
    root = fromstring(describe(model, name, digest(files), date, exchanging=True))
    for interface in root.findall("ModelExchange") + root.findall("CoSimulation"):
        SubElement(SubElement(interface, "SourceFiles"), "File", name=MAIN_SOURCE[fmi])
    files["guid.h"] = render_guid_header(root.attrib["guid"])
    return files, xml_bytes(root)
