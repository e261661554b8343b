"""Runs any FMU: one of ours at its solver's own steps, somebody else's until two results agree."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..errors import HarnessError
from .description import description
from .fmu import Report, simulate
from .foreign import job as foreign
from .foreign.rows import RECORDED, elements
from .run import Run
from .settings import NEEDED
from .specification import Specification

POINTS = 512  # communication steps of a run from which nothing else is asked


def run(wanted: Specification, report: Report) -> Run:
    """The run that is wanted, of every output if none is named; HarnessError if it fails with nothing to show."""
    found = description(wanted.fmu, wanted.lenient)
    wanted = replace(wanted, outputs=wanted.outputs or outputs(found, wanted.values))
    if not wanted.outputs:
        raise HarnessError(f"{wanted.fmu.name} has no variable that changes: there is nothing to record")
    ours = shows_steps(found) and not wanted.exchange
    return simulate(wanted, report) if ours else foreign.simulate(wanted, found, report)


def shows_steps(found: Any) -> bool:
    """Whether an FMU tells the steps of its solver, as ours of FMI 2.0 do."""
    names = [variable.name for variable in found.modelVariables]
    return found.fmiVersion == "2.0" and found.coSimulation is not None and all(name in names for name in NEEDED)


def outputs(found: Any, values: Mapping[str, Any] | None = None) -> tuple[str, ...]:
    """The outputs of an FMU with such values, arrays by their elements; without any, what it computes inside."""
    for causality in ("output", "local"):
        names = [
            element
            for variable in found.modelVariables
            if variable.causality == causality and variable.variability != "constant" and variable.type in RECORDED
            for element in elements(variable.name, foreign.shape(variable, values or {}))
        ]
        if names:
            return tuple(names)
    return ()
