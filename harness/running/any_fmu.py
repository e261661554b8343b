"""Runs anyone's FMU, FMI 2.0 or 3.0, co-simulation or model exchange, through fmpy.

One of ours runs at its solver's own steps.  Another does not tell where these end, so its communication steps are
halved until two results agree.
"""

from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from ..errors import HarnessError, SceneError, reason, unknown
from .description import description
from .fmu import Report, simulate
from .settings import NEEDED, unit
from .specification import Specification
from .trajectory import Trajectory, of_run
from .unpacked import unpacked

COARSEST = 64  # communication steps of the first run
FINEST = 2**18
POINTS = 512  # communication steps of a run of ours from which nothing else is asked: those of others meet them
NUMBERS = ("Real", "Float64", "Float32", "Integer", "Enumeration", "Boolean", "Int32", "Int64")


def own(path: Path, stop: float | None, values: dict[str, Any], grid: float | None) -> Specification | None:
    """What runs one of our FMUs, every output recorded; None for an FMU that does not show its steps."""
    found = description(path)
    names = [variable.name for variable in found.modelVariables]
    if found.fmiVersion != "2.0" or any(name not in names for name in NEEDED):
        return None
    outputs = tuple(variable.name for variable in found.modelVariables if variable.causality == "output")
    return Specification(path, outputs, values, stop=stop, grid=grid, even=POINTS)


def run(
    path: Path,
    stop: float | None,
    tolerance: float,
    values: dict[str, Any],
    report: Report,
    grid: float | None = None,
) -> Trajectory:
    """The outputs of an FMU, ours or anyone's; `tolerance` is for anyone's, the `grid` in s for ours."""
    wanted = own(path, stop, values, grid)
    return of_run(simulate(wanted, report)) if wanted else halved(path, stop, tolerance, values, report)


def halved(path: Path, stop: float | None, tolerance: float, values: dict[str, Any], report: Report) -> Trajectory:
    """Run with ever shorter communication steps, until the outputs of two runs differ by less than `tolerance` of
    their largest value at the times of the coarsest.  HarnessError if the FMU fails or they never do."""
    found = description(path)
    variables = {variable.name: variable for variable in found.modelVariables}
    for name in values:
        if name not in variables:
            raise SceneError(unknown("variable to set", name, variables))
    outputs = [
        v.name for v in found.modelVariables if v.causality == "output" and v.type in NUMBERS and not v.dimensions
    ]
    if not outputs:
        raise HarnessError(f"{path.name} has no scalar number among its outputs: there is nothing to record")
    experiment = found.defaultExperiment
    start = float(experiment.startTime or 0.0) if experiment else 0.0
    if stop is None and not (experiment and experiment.stopTime):
        raise SceneError(f"{path.name} names no stop time; name one, as in --stop 10")
    end = float(experiment.stopTime) if stop is None else stop
    if not end > start:
        raise SceneError(f"stop = {end!r} s is not after start = {start!r} s")
    tuned = [variable for variable in variables.values() if variable.causality == "parameter"]
    parameters = {each.name: (values.get(each.name, each.start), unit(each)) for each in tuned}
    with unpacked(path) as folder:
        steps, before, difference = COARSEST, None, np.inf
        while steps <= FINEST:
            now = once(path, folder, start, end, steps, outputs, values)
            if before is not None:
                difference = apart(before, now, outputs, steps // COARSEST)
                if difference <= tolerance:
                    units = {name: unit(variables[name]) for name in outputs}
                    columns = {name: now[name].astype(float) for name in outputs}
                    h = (end - start) / steps
                    note = f"communication step {h:.4g} s; half of it changes no output by more than {difference:.2g}"
                    return Trajectory(path.stem, now["time"], columns, units, None, note, path, parameters)
            before, steps = now, 2 * steps
            report(np.log2(steps / COARSEST) / np.log2(FINEST / COARSEST))
    raise HarnessError(
        f"{path.name}: with {steps // 2} communication steps the last halving still changes an output by "
        f"{difference:.2g} of its largest value, more than the tolerance of {tolerance:g}; raise --tolerance"
    )


def once(
    path: Path, folder: Path, start: float, stop: float, steps: int, outputs: list[str], values: dict[str, Any]
) -> np.ndarray:
    """The recorded outputs, a structured array (steps + 1,), of one run of the FMU that is unpacked in a folder.

    HarnessError with the FMU's own words if it fails.
    """
    said: list[str] = []

    def keep(component: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        said.append(text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text))

    h = (stop - start) / steps
    try:
        rows = fmpy.simulate_fmu(
            str(folder),
            start_time=start,
            stop_time=stop,
            output_interval=h,
            start_values=values,
            output=outputs,
            logger=keep,
            debug_logging=True,
        )
    except Exception as error:  # as above
        raise HarnessError(f"{path.name}: {said[-1] if said else reason(error)}") from None
    if not abs(rows["time"][-1] - stop) < 0.01 * h or len(rows) != steps + 1:
        last = said[-1] if said else "it gives no reason"
        raise HarnessError(f"{path.name} stopped at t = {rows['time'][-1]!r} s, before {stop!r} s: {last}")
    for name in outputs:
        if not np.isfinite(rows[name].astype(float)).all():
            raise HarnessError(f"{path.name}: {name} is not finite")
    return rows


def apart(coarse: np.ndarray, fine: np.ndarray, outputs: list[str], every: int) -> float:
    """The largest difference of two runs, the second of twice the steps, at the times of the coarsest."""
    worst = 0.0
    for name in outputs:
        one, two = (rows[name][::step].astype(float) for rows, step in ((coarse, every // 2), (fine, every)))
        size = float(np.abs(two).max())
        worst = max(worst, float(np.abs(one - two).max()) / size if size else 0.0)
    return worst
