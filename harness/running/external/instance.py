"""Instances of external FMUs: FMI 2.0 or 3.0, co-simulation or model exchange."""

import os
from typing import Any

from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave

from ...errors import HarnessError, first_line
from ..fmi2 import WARNING, shared_callbacks

STATUS_NAMES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
MAX_MESSAGES = 50  # log messages that are kept
MESSAGES = shared_callbacks()[1]


def instantiate(description: Any, folder: str, exchange: bool) -> Any:
    """Create an instance."""
    is_fmi2 = description.fmiVersion == "2.0"
    kind = {(True, True): FMU2Model, (True, False): FMU2Slave, (False, True): FMU3Model, (False, False): FMU3Slave}
    interface = description.modelExchange if exchange else description.coSimulation
    try:
        factory = kind[is_fmi2, exchange]
        fmu = factory(guid=description.guid or "", unzipDirectory=folder, modelIdentifier=interface.modelIdentifier)
        fmu.instantiate(
            loggingOn=True, **({"callbacks": shared_callbacks()[0]} if is_fmi2 else {"logMessage": log_message})
        )
    except Exception as error:  # fmpy raises bare Exceptions
        hint = "; it needs the tool that made it (needsExecutionTool)" if interface.needsExecutionTool else ""
        raise HarnessError(f"{first_line(error).replace(f'{folder}{os.sep}', '')}{hint}") from None
    return fmu


def log_message(environment: Any, status: int, category: bytes, text: bytes) -> None:
    """Store a log message of FMI 3.0."""
    MESSAGES.append((status, (text or b"").decode("utf-8", "replace")))


def last_error_message() -> str:
    """Return the last log message above a warning in one line; empty if there is none."""
    messages = [text for status, text in MESSAGES if status > WARNING and text.strip()]
    return " ".join(messages[-1].split()) if messages else ""


def trim_messages() -> None:
    """Discard all but the last messages."""
    del MESSAGES[:-MAX_MESSAGES]


def initialize(fmu: Any, description: Any, values: dict[str, Any], start: float, stop: float, tolerance: float) -> None:
    """Set values and initialize an instance; times in s."""
    variables = {variable.name: variable for variable in description.modelVariables}
    structural = [name for name in values if variables[name].causality == "structuralParameter"]
    if structural:
        fmu.enterConfigurationMode()
        for name in structural:
            set_variable(fmu, description, variables[name], values[name])
        fmu.exitConfigurationMode()
    experiment = {"tolerance": tolerance, "startTime": start, "stopTime": stop}
    if description.fmiVersion == "2.0":
        fmu.setupExperiment(**experiment)
    for name, value in values.items():
        if name not in structural:
            set_variable(fmu, description, variables[name], value)
    fmu.enterInitializationMode(**({} if description.fmiVersion == "2.0" else experiment))
    fmu.exitInitializationMode()


def set_variable(fmu: Any, description: Any, variable: Any, value: Any) -> None:
    """Set a variable of any type and shape."""
    integer_type = "Integer" if description.fmiVersion == "2.0" else "Int64"
    setter = getattr(fmu, "set" + (integer_type if variable.type == "Enumeration" else variable.type))
    setter([variable.valueReference], value if isinstance(value, list) else [value])
