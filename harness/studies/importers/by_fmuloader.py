"""A request carried out by fmuloader, call by call, in the order of fmpy."""

import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fmuloader.fmi2 import Fmi2Error, Fmi2Slave, Fmi2Status, Fmi2Type

from ...running.description import description
from ...running.fmu import FMICallException
from ...running.unpacked import unpacked
from .by_fmpy import played
from .request import Reply, Request, serve


class Instance:
    """An instance of fmuloader's under the names that fmpy gives its calls."""

    def __init__(self, folder: Path, found: Any, name: str) -> None:
        identifier = found.coSimulation.modelIdentifier
        self.slave = Fmi2Slave(folder, model_identifier=identifier)
        self.slave.instantiate(
            name, Fmi2Type.CO_SIMULATION, guid=found.guid, logging_on=True, log_message_callback=hear
        )

    def call(self, name: str, *arguments: Any, **named: Any) -> Any:
        """What a call returns; above a warning, which for fmuloader is no error yet, an exception."""
        try:
            answer = getattr(self.slave, name)(*arguments, **named)
        except Fmi2Error as error:
            raise FMICallException(error.func_name, int(error.status)) from None
        if answer is Fmi2Status.DISCARD:
            raise FMICallException(name, int(answer))
        return answer

    def setReal(self, references: list[int], values: list[float]) -> None:
        self.call("set_real", references, values)

    def getReal(self, references: list[int]) -> Any:
        return self.call("get_real", references)

    def setupExperiment(self, startTime: float) -> None:
        self.call("setup_experiment", start_time=startTime)

    def enterInitializationMode(self) -> None:
        self.call("enter_initialization_mode")

    def exitInitializationMode(self) -> None:
        self.call("exit_initialization_mode")

    def doStep(self, t: float, h: float) -> None:
        self.call("do_step", t, h)

    def reset(self) -> None:
        self.call("reset")

    def freeInstance(self) -> None:
        self.slave.free_instance()


def hear(environment: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
    """Print the log."""
    print(f"log: {text.decode()}", file=sys.stderr, flush=True)


def play(request: Request) -> Reply:
    found = description(Path(request.fmu))
    with unpacked(Path(request.fmu)) as folder:
        return played(request, [Instance(folder, found, name) for name in request.instances], version("fmuloader"))


if __name__ == "__main__":
    serve(play)
