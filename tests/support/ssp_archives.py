"""Small SSP archives: two components `source` and `sink` of the FMU Gain, y = k u + c, and one feature each.

The source has y = 3 and drives u of the sink, so the sink ends at y = 5 convert(3), where convert is the feature.
"""

from zipfile import ZipFile

NAMESPACES = " ".join(
    f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for short, name in (
        ("ssc", "Common"),
        ("ssd", "Description"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
        ("ssb", "SignalDictionary"),
    )
)
CONNECTION = 'startElement="source" startConnector="y" endElement="sink" endConnector="u"'
UNIT_TABLE = (
    '<ssd:Units><ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit><ssc:Unit name="mm"><ssc:BaseUnit m="1" '
    'factor="0.001"/></ssc:Unit><ssc:Unit name="kg"><ssc:BaseUnit kg="1"/></ssc:Unit></ssd:Units>'
)


def parameter_set(**values):
    """Return a parameter set, as in a file."""
    rows = "".join(
        f'<ssv:Parameter name="{name.replace("__", ".")}"><ssv:Real value="{value}"/></ssv:Parameter>'
        for name, value in values.items()
    )
    head = f'<ssv:ParameterSet {NAMESPACES} version="1.0" name="values">'
    return f"{head}<ssv:Parameters>{rows}</ssv:Parameters></ssv:ParameterSet>"


def bind(source, more=""):
    """Return a binding to a file, with a mapping."""
    return (
        f'<ssd:ParameterBindings><ssd:ParameterBinding source="resources/{source}.ssv">{more}</ssd:ParameterBinding>'
        "</ssd:ParameterBindings>"
    )


def bind_inline(values):
    """Return a binding with values in place."""
    return (
        "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>"
        f"{values}</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def component(name, bindings, unit=""):
    """Return a component with its connectors and bindings; the source has no input."""
    attribute = f' unit="{unit}"' if unit else ""
    connectors = "".join(
        f'<ssd:Connector name="{connector}" kind="{kind}">'
        f"<ssc:Real{attribute if kind != 'parameter' else ''}/></ssd:Connector>"
        for connector, kind in (("u", "input"), ("y", "output"), ("k", "parameter"), ("c", "parameter"))
        if (name, connector) != ("source", "u")
    )
    return (
        f'<ssd:Component name="{name}" type="application/x-fmu-sharedlibrary" source="resources/Gain.fmu">'
        f"<ssd:Connectors>{connectors}</ssd:Connectors>{bindings}</ssd:Component>"
    )


def structure(elements, connections=f"<ssd:Connection {CONNECTION}/>", version="1.0", bindings="", more="", units=""):
    """Return the description of a system."""
    links = f"<ssd:Connections>{connections}</ssd:Connections>" if connections else ""
    return (
        f'<ssd:SystemStructureDescription {NAMESPACES} name="pair" version="{version}"><ssd:System name="pair">'
        f"{bindings}<ssd:Elements>{elements}</ssd:Elements>{links}{more}</ssd:System>{units}"
        '<ssd:DefaultExperiment startTime="0" stopTime="1"/></ssd:SystemStructureDescription>'
    )


SOURCE, SINK = component("source", bind("source")), component("sink", bind("sink"))
FILES = {"source": parameter_set(c=3), "sink": parameter_set(k=5)}
TRANSFORMED = f'<ssd:Connection {CONNECTION}><ssc:LinearTransformation factor="2" offset="0.5"/></ssd:Connection>'
INNER = (
    '<ssd:System name="inner"><ssd:Connectors><ssd:Connector name="in" kind="input"><ssc:Real/></ssd:Connector>'
    f"</ssd:Connectors><ssd:Elements>{SINK}</ssd:Elements><ssd:Connections>"
    '<ssd:Connection startConnector="in" endElement="sink" endConnector="u"/></ssd:Connections></ssd:System>'
)
MAPPING = (
    f'<ssd:ParameterMapping><ssm:ParameterMapping {NAMESPACES} version="1.0">'
    '<ssm:MappingEntry source="gain" target="k">'
    '<ssc:LinearTransformation factor="10"/></ssm:MappingEntry></ssm:ParameterMapping></ssd:ParameterMapping>'
)

ARCHIVES = {  # description of the system, files, y of the sink at the end
    "plain": (structure(SOURCE + SINK), FILES, 15.0),
    "inputs without a connection": (structure(SOURCE + SINK + component("third", "")), FILES, 15.0),
    "SSP 2.0": (structure(SOURCE + SINK, version="2.0"), FILES, 15.0),
    "linear transformations": (structure(SOURCE + SINK, TRANSFORMED), FILES, 32.5),
    "unit conversions": (
        structure(component("source", bind("source"), "m") + component("sink", bind("sink"), "mm"), units=UNIT_TABLE),
        FILES,
        15000.0,
    ),
    "inline parameter values": (
        structure(SOURCE + component("sink", bind_inline(parameter_set(k=5)))),
        FILES,
        15.0,
    ),
    "mapped parameters": (
        structure(SOURCE + component("sink", bind("sink", MAPPING))),
        FILES | {"sink": parameter_set(gain=0.5)},
        15.0,
    ),
    "nested systems": (
        structure(
            SOURCE + INNER,
            '<ssd:Connection startElement="source" startConnector="y" endElement="inner" endConnector="in"/>',
        ),
        FILES,
        15.0,
    ),
    "values of the system": (
        structure(SOURCE + SINK, bindings=bind("system")),
        FILES | {"system": parameter_set(sink__k=7)},
        21.0,
    ),
}


def write_archive(path, description, files, fmu):
    """Write an archive with the FMU Gain."""
    with ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", description)
        archive.write(fmu, "resources/Gain.fmu")
        for name, text in files.items():
            archive.writestr(f"resources/{name}.ssv", text)
    return path
