"""Builds native FMU files: the same model description as the Python FMU, no Python inside, reproducible bytes.

modelDescription.xml
binaries/<platform>/<name>.{so,dll,dylib}
sources/                                  the C sources, for any other platform
resources/model_data.json                 what the model description cannot state (model_data.py)
documentation/, extra/                    documentation, licence and certified result
model.png                                 the icon; in FMI 3.0 terminalsAndIcons/, with the terminal
"""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, fromstring

from ...compiler import BuildError
from ...compiler.embedded_modules import digest, installed_package
from ...compiler.lowering import lowered_model, model_exchange_run, select_features
from ...compiler.model_lookup import find_model
from ...compiler.text_output import xml_bytes
from ...runtime.variable_declarations import VariableOwner
from ..archive import build_date, license_files, write, zip_entries
from ..extra_files import extra_files, terminals
from ..fmi_variables import declared_variables
from ..model_description import describe
from ..model_description_fmi3 import describe as describe3
from .binaries import DEFAULT_PLATFORMS, PLATFORMS, CompilerPool, compile_binaries
from .model_header import render_model_header

MAIN_SOURCE = {"2": "fmi2.c", "3": "fmi3.c"}  # by version of FMI; includes all other files
OWN_HEADERS = (
    "common_functions.h",
    "instance.h",
    "python_arithmetic.h",
    "saved_state.h",
    "stderr_output.h",
    "text_buffer.h",
    "variable.h",
)
FMI_HEADERS = {  # 2-clause BSD license
    "2": ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    "3": ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
LICENSE = "documentation/licenses/license.txt"
ICON_PATHS = {"2": "model.png", "3": "terminalsAndIcons/icon.png"}
USAGE_NOTE = """\
<p>In model exchange the importer's solver integrates the model, and <code>solver.*</code> has no meaning. With dry
friction, the mode changes at events, which the importer locates with the event indicators <code>events.to_rest</code>
and <code>events.to_break_away</code>. In FMI 3.0 co-simulation the importer can handle events as well: a step returns
early at stick and slip, or asks for event handling at its end if early return is not allowed.</p>
<p>This FMU needs no other software. A refused call and a failed run return Error.</p>
"""


def build(
    model: str | Path,
    folder: Path,
    methods: Sequence[str] = (),
    laws: Sequence[str] = (),
    platforms: Sequence[str] = (),
    fmi: str = "2",
    real_only: bool = False,
) -> Path:
    """Build the native FMU of a model and write it to `folder`, replacing an older one atomically.

    Parameters
    ----------
    model
        Name or path of the model.
    folder
        Output folder.
    methods, laws
        Labels of the methods and friction laws to include; none: all.
    platforms
        Platforms to compile for; none: DEFAULT_PLATFORMS.
    fmi
        Version of FMI: "2" or "3".
    real_only
        Whether all variables are Reals, with one method and one law, for hosts without other types.
    """
    platforms = platforms or DEFAULT_PLATFORMS
    for platform in platforms:
        if platform not in PLATFORMS:
            raise BuildError(f"There is no platform {platform!r}; choose from {', '.join(PLATFORMS)}.")
    date = build_date()
    source = replace(find_model(model), has_input_derivatives=fmi == "2")  # FMI 3.0 cannot set derivatives of inputs
    name, cls = source.name, lowered_model(source, select_features(source, methods, laws, real_only))
    files, description = generate_c_sources(cls, name, date, fmi)
    declarations = declared_variables(cls)
    entries = extra_files(cls, source.path, declarations, source.analysis, ICON_PATHS[fmi], USAGE_NOTE)
    if fmi == "3":
        entries |= terminals(declarations, bool(source.analysis.planar_contacts))
    entries |= {"modelDescription.xml": description, LICENSE: license_files()[LICENSE]}
    entries |= {f"sources/{file}": text.encode() for file, text in files.items()}
    entries["sources/buildDescription.xml"] = render_build_description(name, fmi)
    with CompilerPool() as pool:
        for content in pool.map(
            lambda platform: compile_binaries(name, files, MAIN_SOURCE[fmi], platform, fmi), platforms
        ):
            entries |= content
    return write(folder / f"{name}.fmu", zip_entries(entries, date))


def generate_c_sources(model: type[VariableOwner], name: str, date: datetime, fmi: str) -> tuple[dict[str, str], bytes]:
    """Return the C sources of a model by file name, and the matching modelDescription.xml."""
    files = collect_sources(model, fmi)
    _, run = model_exchange_run(model)
    nominals = run.model_exchange.nominals
    if fmi == "3":
        root = fromstring(describe3(model, name, digest(files), date, nominals))
        files["guid.h"] = render_guid_header(root.attrib["instantiationToken"])
        return files, xml_bytes(root)
    root = fromstring(describe(model, name, digest(files), date, nominals))
    for interface in root.findall("ModelExchange") + root.findall("CoSimulation"):
        SubElement(SubElement(interface, "SourceFiles"), "File", name=MAIN_SOURCE[fmi])
    files["guid.h"] = render_guid_header(root.attrib["guid"])
    return files, xml_bytes(root)


def collect_sources(model: type[VariableOwner], fmi: str) -> dict[str, str]:
    """Return names and texts of all files except guid.h, which depends on their content."""
    folder = Path(__file__).parent
    own_files = {name: (folder / name).read_text(encoding="utf-8") for name in (MAIN_SOURCE[fmi], *OWN_HEADERS)}
    fmi_headers = installed_package("fmpy") / "c-code"
    headers = {name: (fmi_headers / name).read_text(encoding="utf-8") for name in FMI_HEADERS[fmi]}
    return own_files | headers | {"model.h": render_model_header(model, fmi)}


def render_guid_header(guid: str) -> str:
    """Return the text of guid.h, which identifies this build in model descriptions and saved states."""
    return f'#define MODEL_GUID "{guid}"\n'


def render_build_description(name: str, fmi: str) -> bytes:
    """Return buildDescription.xml, which describes how to compile the sources (FMI 3.0, section 2.5.2)."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = SubElement(configuration, "SourceFileSet", language="C99")
    SubElement(files, "SourceFile", name=MAIN_SOURCE[fmi])
    SubElement(configuration, "Library", name="m", external="true", description="C math library")
    return xml_bytes(root)
