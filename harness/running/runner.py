"""Runs any FMU: one of this project at its solver's own steps, an external one with step refinement."""

from collections.abc import Mapping
from dataclasses import replace
from math import prod
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..scenes.run_spec import RunSpec
from .fmu_archive import exposes_solver_steps, read_description
from .own_fmu import ProgressCallback, simulate
from .recorder import C_TYPES, array_shape, element_names
from .trajectory import Trajectory

DEFAULT_COMMUNICATION_STEPS = 512  # of a run without a communication step of its own
MAX_DEFAULT_OUTPUTS = 1000  # values recorded at each point of a run that names no outputs


def run(spec: RunSpec, report: ProgressCallback) -> Trajectory:
    """Run an FMU as specified; without outputs in the specification, record all of them.

    Parameters
    ----------
    spec : RunSpec
    report : callable
        Receives the progress of the run, from 0 to 1.

    Raises
    ------
    HarnessError
        If the run fails and there is nothing to show.
    """
    description = read_description(spec.fmu, spec.lenient)
    spec = replace(spec, outputs=spec.outputs or default_outputs(description, spec.values))
    if not spec.outputs:
        raise HarnessError(f"{spec.fmu.name} has no outputs or locals to record")
    if exposes_solver_steps(description) and not spec.exchange:
        trajectory = simulate(spec, report)
    else:
        from .external import simulation as external

        trajectory = external.simulate(spec, description, report)
    return trajectory if spec.interval is None else keep_interval(trajectory, spec.interval)


def keep_interval(run: Trajectory, interval: float) -> Trajectory:
    """Keep the points of a run at multiples of an interval in s, and its last one."""
    start = run.time[0]
    near = 1e-9 * interval
    keep = np.abs(start + np.rint((run.time - start) / interval) * interval - run.time) <= near
    keep[-1] = True
    return replace(run, time=run.time[keep], columns={name: column[keep] for name, column in run.columns.items()})


def default_outputs(description: Any, values: Mapping[str, Any] | None = None) -> tuple[str, ...]:
    """Return the outputs of an FMU, or its locals if it has none. Arrays are listed by element.

    Parameters
    ----------
    description : ModelDescription
    values : mapping, optional
        Values that are set. Structural parameters among them determine the shapes of arrays.

    Raises
    ------
    HarnessError
        If there are too many to record all of them.
    """
    for causality in ("output", "local"):
        shapes = {
            variable.name: array_shape(variable, values or {})
            for variable in description.modelVariables
            if variable.causality == causality and variable.variability != "constant" and variable.type in C_TYPES
        }
        if (count := sum(map(prod, shapes.values()))) > MAX_DEFAULT_OUTPUTS:
            raise HarnessError(
                f"{description.modelName} has {count} {causality}s, more than the {MAX_DEFAULT_OUTPUTS} that are "
                "recorded by default: run it as a scene that names those to record, as in outputs = ['x']"
            )
        if count:
            return tuple(element for name, shape in shapes.items() for element in element_names(name, shape))
    return ()
