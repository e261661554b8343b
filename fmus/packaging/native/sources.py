"""The folder sources/ of a native FMU: all that a C compiler needs, the FMI headers included."""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from ...runtime.variable_declarations import VariableOwner
from ..embedded_modules import installed_package
from ..xml_output import xml_bytes
from .interface import header

COMPILED = {"2": "fmi2.c", "3": "fmi3.c"}  # by the version of FMI: includes all the others
WRITTEN = ("calls.h", "instance.h", "numerics.h", "say.h", "state.h", "text.h", "variable.h")
FMI_HEADERS = {  # 2-clause BSD, as they say
    "2": ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    "3": ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}


def sources(model: type[VariableOwner], fmi: str) -> dict[str, str]:
    """Name and text of every file but guid.h, which follows from these."""
    here = Path(__file__).parent
    written = {name: (here / name).read_text(encoding="utf-8") for name in (COMPILED[fmi], *WRITTEN)}
    theirs = installed_package("fmpy") / "c-code"
    headers = {name: (theirs / name).read_text(encoding="utf-8") for name in FMI_HEADERS[fmi]}
    return written | headers | {"model.h": header(model, fmi)}


def guid_header(guid: str) -> str:
    """guid.h: states and descriptions of other builds are told by it."""
    return f'#define MODEL_GUID "{guid}"\n'


def build_description(name: str, fmi: str) -> bytes:
    """buildDescription.xml: how to compile the sources (FMI 3.0, section 2.5.2; FMI 2.0 has no such file)."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = SubElement(configuration, "SourceFileSet", language="C99")
    SubElement(files, "SourceFile", name=COMPILED[fmi])
    SubElement(configuration, "Library", name="m", external="true", description="the C library of mathematics")
    return xml_bytes(root)
