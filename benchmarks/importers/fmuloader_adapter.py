"""Adapter of fmuloader, with the same calls as fmpy."""

import re
import sys
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fmuloader.fmi2 import Fmi2Error, Fmi2Slave, Fmi2Status, Fmi2Type

from harness.simulation.fmu_archive import read_description, unpack_once
from harness.simulation.fmu_instance import FMICallException

from .fmpy_adapter import run_instances
from .request import ImporterReply, ImporterRequest


class Instance:
    """An instance of fmuloader with the method names of fmpy."""

    def __init__(self, folder: Path, fmu_description: Any, name: str) -> None:
        identifier = fmu_description.coSimulation.modelIdentifier
        self.slave = Fmi2Slave(folder, model_identifier=identifier)
        self.slave.instantiate(
            name, Fmi2Type.CO_SIMULATION, guid=fmu_description.guid, logging_on=True, log_message_callback=print_message
        )

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return partial(self.call, snake_case(name))

    def call(self, name: str, *arguments: Any, **options: Any) -> Any:
        """Call a function; raise FMICallException for a status above warning, also for discard."""
        try:
            result = getattr(self.slave, name)(*arguments, **{snake_case(key): value for key, value in options.items()})
        except Fmi2Error as error:
            raise FMICallException(error.func_name, int(error.status)) from None
        if result is Fmi2Status.DISCARD:
            raise FMICallException(name, int(result))
        return result


def snake_case(name: str) -> str:
    """Convert a name to snake case: doStep to do_step."""
    return re.sub("[A-Z]", lambda capital: f"_{capital[0].lower()}", name)


def print_message(environment: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
    """Print a log message."""
    print(f"log: {text.decode()}", file=sys.stderr, flush=True)


def run_request(request: ImporterRequest) -> ImporterReply:
    fmu_description = read_description(request.run.fmu)
    instances = [Instance(unpack_once(request.run.fmu), fmu_description, name) for name in request.instances]
    return run_instances(request, instances, version("fmuloader"))
