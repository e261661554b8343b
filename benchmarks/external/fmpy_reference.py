"""Reference of an external FMU: runs it by fmpy's own loop, in a process of its own, because an FMU may crash.

Arguments: FMU, stop time in s or "", folder. Writes reference.csv and record.csv, the latter with another value of the
first parameter that changes an output, and prints that parameter, its start value and the other value as JSON.
"""

import json
import sys
from contextlib import suppress
from math import ceil
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

MAX_STEPS = 4000
TOLERANCE = 1e-7  # which `compare` passes to an FMU, a tenth of the default of its runs
FACTOR, OFFSET = 1.05, 0.1  # the other value of a parameter: start value times FACTOR, or OFFSET if that is 0
MAX_PARAMETERS = 12  # parameters that are tried


def other_value(start: float) -> float:
    """Return a value that differs a little from the start value."""
    return start * FACTOR or OFFSET


def simulate(fmu: str, stop: float, step: float, values: dict[str, float]) -> Any:
    """Run the FMU by fmpy."""
    options = {"stop_time": stop, "output_interval": step, "relative_tolerance": TOLERANCE}
    return fmpy.simulate_fmu(fmu, validate=False, start_values=values, **options)


def main(fmu: str, stop_text: str, folder: Path) -> None:
    """Write the reference and the record, and print the parameter."""
    description = fmpy.read_model_description(fmu, validate=False)
    experiment, interface = description.defaultExperiment, description.coSimulation
    start = float((experiment and experiment.startTime) or 0.0)
    stop = float(stop_text or experiment.stopTime)
    step = float(
        (interface and interface.fixedInternalStepSize) or (experiment and experiment.stepSize) or (stop - start) / 100
    )
    step *= ceil((stop - start) / step / MAX_STEPS)
    reference = simulate(fmu, stop, step, {})
    fmpy.write_csv(str(folder / "reference.csv"), reference)
    candidates = [
        variable
        for variable in description.modelVariables
        if variable.causality == "parameter"
        and variable.type in ("Real", "Float64")
        and variable.variability != "constant"
        and not variable.dimensions
        and variable.start is not None
    ]
    for variable in candidates[:MAX_PARAMETERS]:
        value = other_value(float(variable.start))
        with suppress(Exception):  # fmpy raises bare Exceptions: the FMU refuses the value
            record = simulate(fmu, stop, step, {variable.name: value})
            if len(record) == len(reference) and any(
                record.dtype[name].kind == "f"
                and np.abs(record[name] - reference[name]).max() > 1e-6 * np.abs(reference[name]).max()
                for name in record.dtype.names[1:]
            ):
                fmpy.write_csv(str(folder / "record.csv"), record)
                print(json.dumps([variable.name, float(variable.start), value]))
                return
    if candidates:
        print(json.dumps([candidates[0].name, float(candidates[0].start), other_value(float(candidates[0].start))]))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
