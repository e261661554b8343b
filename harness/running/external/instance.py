"""An instance of somebody's FMU: FMI 2.0 or 3.0, for co-simulation or for model exchange."""

import os
from typing import Any

from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave

from ...errors import HarnessError, first_line
from ..fmi2 import WARNING, shared_callbacks

STATUS_NAMES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
MAX_MESSAGES = 50  # messages of the log that are kept
MESSAGES = shared_callbacks()[1]


def instantiate(found: Any, folder: str, exchange: bool) -> Any:
    """A new instance."""
    old = found.fmiVersion == "2.0"
    kind = {(True, True): FMU2Model, (True, False): FMU2Slave, (False, True): FMU3Model, (False, False): FMU3Slave}
    interface = found.modelExchange if exchange else found.coSimulation
    try:
        make = kind[old, exchange]
        fmu = make(guid=found.guid or "", unzipDirectory=folder, modelIdentifier=interface.modelIdentifier)
        fmu.instantiate(
            loggingOn=True, **({"callbacks": shared_callbacks()[0]} if old else {"logMessage": log_message})
        )
    except Exception as error:  # fmpy raises bare Exceptions
        tool = "; it needs the tool that made it (needsExecutionTool)" if interface.needsExecutionTool else ""
        raise HarnessError(f"{first_line(error).replace(f'{folder}{os.sep}', '')}{tool}") from None
    return fmu


def log_message(environment: Any, status: int, category: bytes, text: bytes) -> None:
    """The logger of FMI 3.0."""
    MESSAGES.append((status, (text or b"").decode("utf-8", "replace")))


def last_error_message() -> str:
    """The last that the FMU has logged beyond a warning, in one line; empty if it says nothing."""
    told = [text for status, text in MESSAGES if status > WARNING and text.strip()]
    return " ".join(told[-1].split()) if told else ""


def trim_messages() -> None:
    """Keep the last messages only."""
    del MESSAGES[:-MAX_MESSAGES]


def initialize(fmu: Any, found: Any, values: dict[str, Any], start: float, stop: float, tolerance: float) -> None:
    """Set values, and initialise: times in s."""
    variables = {variable.name: variable for variable in found.modelVariables}
    structural = [name for name in values if variables[name].causality == "structuralParameter"]
    if structural:
        fmu.enterConfigurationMode()
        for name in structural:
            set_variable(fmu, found, variables[name], values[name])
        fmu.exitConfigurationMode()
    experiment = {"tolerance": tolerance, "startTime": start, "stopTime": stop}
    if found.fmiVersion == "2.0":
        fmu.setupExperiment(**experiment)
    for name, value in values.items():
        if name not in structural:
            set_variable(fmu, found, variables[name], value)
    fmu.enterInitializationMode(**({} if found.fmiVersion == "2.0" else experiment))
    fmu.exitInitializationMode()


def set_variable(fmu: Any, found: Any, variable: Any, value: Any) -> None:
    """Set one variable, of whatever type and shape."""
    whole = "Integer" if found.fmiVersion == "2.0" else "Int64"
    setter = getattr(fmu, "set" + (whole if variable.type == "Enumeration" else variable.type))
    setter([variable.valueReference], value if isinstance(value, list) else [value])
