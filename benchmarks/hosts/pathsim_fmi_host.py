"""Run an FMU in PathSim with pathsim-fmi. It is a script of their environment, and imports nothing of this project.

The argument is a JSON list of runs: FMU, communication step and stop in s, name of an output. For each run it prints a
JSON line: values and text of a failure. On standard error a line with the mark --- precedes the messages of each run.
"""

import json
import sys

from pathsim import Connection, Simulation
from pathsim.blocks import Scope
from pathsim_fmi import CoSimulationFMU


def run(fmu: str, step: float, stop: float, output: str) -> list[float]:
    """Return the values; the block steps at the beginning of a step, so a value is that of the end of the step."""
    block, scope = CoSimulationFMU(fmu, dt=step), Scope()
    simulation = Simulation([block, scope], [Connection(block[output], scope)], dt=step, log=False)
    simulation.run(stop)
    _, (values,) = scope.read()
    return list(map(float, values))


if __name__ == "__main__":
    for arguments in json.loads(sys.argv[1]):
        print("---", file=sys.stderr, flush=True)
        try:
            values, failure = run(*arguments), ""
        except Exception as error:
            values, failure = [], f"{type(error).__name__}: {error}"
        print(json.dumps([values, failure]), flush=True)
