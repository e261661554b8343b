"""Run an FMU in gemseo-fmu. It is a script of the environment of gemseo-fmu, and imports nothing of this project.

The argument is a JSON list of runs: FMU, communication step and stop in s, name of an output. For each run it prints a
JSON line: values and text of a failure. On standard error a line with the mark --- precedes the messages of each run.
"""

import json
import sys

from gemseo_fmu.disciplines.fmu_discipline import FMUDiscipline


def run(fmu: str, step: float, stop: float, output: str) -> list[float]:
    """Return the values. By default, all inputs and parameters are inputs of the discipline."""
    discipline = FMUDiscipline(fmu, output_names=[output], final_time=stop, time_step=step)
    return list(map(float, discipline.execute()[output]))


if __name__ == "__main__":
    for arguments in json.loads(sys.argv[1]):
        print("---", file=sys.stderr, flush=True)
        try:
            values, failure = run(*arguments), ""
        except Exception as error:
            values, failure = [], f"{type(error).__name__}: {error}"
        print(json.dumps([values, failure]), flush=True)
