"""The folder sources/ of a native FMU: everything that a C compiler needs, including the FMI headers."""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from ...compiler.embedded_modules import installed_package
from ...compiler.text_output import xml_bytes
from ...runtime.variable_declarations import VariableOwner
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
