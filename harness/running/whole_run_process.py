"""Child process for repeated runs of an external FMU. Arrays are exchanged by files."""

import json
from functools import cache, lru_cache
from typing import Any

import numpy as np

from ..process.child_process import RequestServer
from ..scenes.run_spec import RunSpec
from .whole_run import MAX_PREPARED, RepeatedRun, RunRequest


@cache
def open_run(shared: str) -> RepeatedRun:
    """Return the session of what runs share, a RunSpec as JSON."""
    return RepeatedRun(RunSpec.from_json(json.loads(shared)))


@lru_cache(MAX_PREPARED)
def load_array(path: str) -> np.ndarray:
    """Return an array; those of earlier requests are the same object again."""
    array: np.ndarray = np.load(path)
    return array


@lru_cache(MAX_PREPARED)
def open_results(folder: str, shape: tuple[int, ...]) -> np.memmap:
    """Return an array in a file, which the results of a shape share."""
    return np.lib.format.open_memmap(f"{folder}/y{shape}.npy", "w+", float, shape)


def run_request(shared: dict[str, Any], run: dict[str, Any] | None, folder: str = "") -> str | None:
    """Run an FMU, or load it if there is no run; return the file of the results, None if there are none."""
    runs = open_run(json.dumps(shared))
    if run is None:
        return None
    inputs = {name: load_array(path) for name, path in run["inputs"].items()}
    y = runs.run(RunRequest(**{**run, "t": load_array(run["t"]), "inputs": inputs}))
    if y is None:
        return None
    results = open_results(folder, y.shape)
    results[:] = y
    return str(results.filename)


if __name__ == "__main__":
    RequestServer().serve(lambda request: run_request(**request))
