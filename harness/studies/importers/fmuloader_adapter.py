"""A request carried out by fmuloader, call by call, in the order of fmpy."""

import re
import sys
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fmuloader.fmi2 import Fmi2Error, Fmi2Slave, Fmi2Status, Fmi2Type

from ...running.description import read_description
from ...running.fmi2 import FMICallException
from ...running.unpacking import unpack_once
from .fmpy_adapter import run_instances
from .request import ImporterReply, ImporterRequest, serve


class Instance:
    """An instance of fmuloader's under the names that fmpy gives its calls."""

    def __init__(self, folder: Path, found: Any, name: str) -> None:
        identifier = found.coSimulation.modelIdentifier
        self.slave = Fmi2Slave(folder, model_identifier=identifier)
        self.slave.instantiate(
            name, Fmi2Type.CO_SIMULATION, guid=found.guid, logging_on=True, log_message_callback=hear
        )

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return partial(self.call, snake(name))

    def call(self, name: str, *arguments: Any, **named: Any) -> Any:
        """What a call returns; above a warning, which for fmuloader is no error yet, an exception."""
        try:
            answer = getattr(self.slave, name)(*arguments, **{snake(key): value for key, value in named.items()})
        except Fmi2Error as error:
            raise FMICallException(error.func_name, int(error.status)) from None
        if answer is Fmi2Status.DISCARD:
            raise FMICallException(name, int(answer))
        return answer


def snake(name: str) -> str:
    """What fmuloader calls something: do_step for doStep."""
    return re.sub("[A-Z]", lambda capital: f"_{capital[0].lower()}", name)


def hear(environment: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
    """Print the log."""
    print(f"log: {text.decode()}", file=sys.stderr, flush=True)


def run_request(request: ImporterRequest) -> ImporterReply:
    found = read_description(Path(request.fmu))
    instances = [Instance(unpack_once(Path(request.fmu)), found, name) for name in request.instances]
    return run_instances(request, instances, version("fmuloader"))


if __name__ == "__main__":
    serve(run_request)
