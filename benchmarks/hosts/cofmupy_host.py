"""Run an FMU in cofmupy. It is a script of the environment of cofmupy, and imports nothing of this project.

The argument is a JSON list of runs: FMU, communication step and stop in s, name of an output. For each run it prints a
JSON line: values and text of a failure. On standard error a line with the mark --- precedes the messages of each run.
"""

import json
import sys
import tempfile
from pathlib import Path

from cofmupy import Coordinator


def run(fmu: str, step: float, stop: float, output: str) -> list[float]:
    """Return the values."""
    configuration = {
        "fmus": [{"id": "model", "path": fmu, "initialization": {}}],
        "connections": [],
        "cosim_method": "jacobi",
        "root": str(Path(fmu).parent),
    }
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "configuration.json"
        file.write_text(json.dumps(configuration))
        coordinator = Coordinator()
        coordinator.start(str(file))
        coordinator.run_simulation(step, stop - 0.5 * step)
    return list(map(float, coordinator.get_results()["model", output]))


if __name__ == "__main__":
    for arguments in json.loads(sys.argv[1]):
        print("---", file=sys.stderr, flush=True)
        try:
            values, failure = run(*arguments), ""
        except Exception as error:
            values, failure = [], f"{type(error).__name__}: {error}"
        print(json.dumps([values, failure]), flush=True)
