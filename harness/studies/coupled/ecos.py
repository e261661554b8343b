"""Runs an SSP archive with Ecos, in a process of its own: python -m harness.studies.coupled.ecos < request > answer.

Both are JSON.  The request names the archive, the step in s, how many of them, and the variables to read after each;
the answer holds a row for each time, the start included.
"""

import ctypes
import json
import os
import sys
from pathlib import Path


def run(archive: str, step: float, count: int, read: list[str]) -> list[list[float]]:
    """The rows of a run."""
    if sys.platform == "linux":
        ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL)
    from ecospy import EcosLib, EcosSimulation

    EcosLib.set_log_level("warn")
    with EcosSimulation(step_size=step, ssp_path=archive) as simulation:
        simulation.init(parameter_set="initialValues")
        rows = [[simulation.get_real(name) for name in read]]
        for _ in range(count):
            simulation.step(1)
            rows.append([simulation.get_real(name) for name in read])
    return rows


if __name__ == "__main__":
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what Ecos and the FMUs print is no answer
    json.dump(run(**json.load(sys.stdin)), answers)
