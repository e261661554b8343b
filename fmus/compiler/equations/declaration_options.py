"""Options of declarations: the table that gives signatures, checks, generated sources, XML and the reference page."""

from typing import Annotated, NamedTuple, TypedDict, get_type_hints


class Options(TypedDict, total=False):
    """Options of calculated variables: type, meaning and, for some, the attribute of a Real in the XML."""

    low: Annotated[float, "Inclusive lower bound."]
    high: Annotated[float, "Inclusive upper bound."]
    above: Annotated[float, "Exclusive lower bound."]
    below: Annotated[float, "Exclusive upper bound."]
    display: Annotated[str, 'Display unit, such as "deg".', "displayUnit"]


class SettableOptions(Options, total=False):
    """Options of parameters and inputs."""

    alias: Annotated[str, "Alternative name, exported in FMI 3.0; of parameters and inputs only."]


class Option(NamedTuple):
    """Type, meaning and XML attribute of an option."""

    type: type
    text: str
    attribute: str = ""


OPTIONS = {
    name: Option(hint.__origin__, *hint.__metadata__)
    for name, hint in get_type_hints(SettableOptions, include_extras=True).items()
}
