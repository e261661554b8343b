"""Adapter of fmpy, which calls its FMI functions."""

import ctypes
import sys
from contextlib import suppress
from typing import Any

import fmpy
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from fmpy.logging import addLoggerProxy

from harness.simulation.fmu_archive import read_description, unpack_once

from .request import ImporterReply, ImporterRequest


def run_request(request: ImporterRequest, prefixes: tuple[str, ...] = ("",)) -> ImporterReply:
    """Execute a request; print log messages that start with one of `prefixes`."""
    fmu_description = read_description(request.run.fmu)
    callbacks = make_callbacks(prefixes)
    arguments = {
        "guid": fmu_description.guid,
        "modelIdentifier": fmu_description.coSimulation.modelIdentifier,
        "unzipDirectory": str(unpack_once(request.run.fmu)),
    }
    instances = [fmi2.FMU2Slave(instanceName=name, **arguments) for name in request.instances]
    for instance in instances:
        instance.instantiate(callbacks=callbacks, loggingOn=True)
    return run_instances(request, instances, fmpy.__version__)


def run_instances(request: ImporterRequest, instances: list[Any], version: str) -> ImporterReply:
    """Execute a request with instances, and free them; `version` is that of the tool."""
    rows, n_accepted = run(request, instances, request.run.values, request.midrun_changes)
    rerun: list[list[float]] = []
    if request.rerun:
        for instance in instances:
            instance.reset()
        rerun, _ = run(request, instances, {}, {})
    for instance in instances:
        instance.freeInstance()
    return ImporterReply(version, rows, rerun, n_accepted)


def run(
    request: ImporterRequest, instances: list[Any], values: dict[str, float], midrun_changes: dict[str, float]
) -> tuple[list[list[float]], int]:
    """Return the rows of one run and the number of accepted steps; a refused value or step ends the run."""
    references = request.references
    output_references = [references[name] for name in request.run.outputs]
    errors: list[FMICallException] = []

    def write(instance: Any, new: dict[str, float]) -> None:
        try:
            instance.setReal([references[name] for name in new], list(new.values()))
        except FMICallException as error:
            errors.append(error)

    def row() -> list[float]:
        return [value for instance in instances for value in instance.getReal(output_references)]

    def transfer() -> None:
        if request.connection:
            source, sink = request.connection
            write(instances[1], {sink: instances[0].getReal([references[source]])[0]})

    write(instances[0], values)
    for instance in instances:
        instance.setupExperiment(startTime=0.0)
        instance.enterInitializationMode()
        with suppress(FMICallException):  # ignored, as for the steps below
            instance.exitInitializationMode()
    rows, n_accepted = [row()], 0
    for i in range(request.steps):
        transfer()
        if i == request.steps // 2:
            write(instances[0], midrun_changes)
        try:
            for instance in instances if not errors else []:
                instance.doStep(request.step * i, request.step)
            n_accepted += not errors
        except FMICallException as error:
            errors.append(error)  # the tool logs the error; the check reads the later values
        rows.append(row())
    return rows, n_accepted


def make_callbacks(prefixes: tuple[str, ...]) -> fmi2.fmi2CallbackFunctions:
    """Return callbacks that print log messages that start with one of `prefixes`."""

    def print_message(environment: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        if text.decode().startswith(prefixes):
            print(f"log: {text.decode()}", file=sys.stderr, flush=True)

    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(print_message)
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks
