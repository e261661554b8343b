"""Child process for repeated runs of an external FMU. Arrays are exchanged by files."""

from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..process.child_process import RequestServer
from .whole_run import MAX_PREPARED, RepeatedRun, RunRequest


@cache
def open_run(fmu: str, settings: tuple[tuple[str, Any], ...], limit: float) -> RepeatedRun:
    """Return the instance of an FMU with settings."""
    return RepeatedRun(Path(fmu), dict(settings), limit)


@lru_cache(MAX_PREPARED)
def load_array(path: str) -> np.ndarray:
    """Return an array; those of earlier requests are the same object again."""
    array: np.ndarray = np.load(path)
    return array


@lru_cache(MAX_PREPARED)
def open_results(folder: str, shape: tuple[int, ...]) -> np.memmap:
    """Return an array in a file, which the results of a shape share."""
    return np.lib.format.open_memmap(f"{folder}/y{shape}.npy", "w+", float, shape)


def run_request(
    fmu: str, settings: dict[str, Any], limit: float, run: dict[str, Any] | None, folder: str = ""
) -> str | None:
    """Run an FMU, or load it if there is no run; return the file of the results, None if there are none."""
    instance = open_run(fmu, tuple(settings.items()), limit)
    if run is None:
        return None
    inputs = {name: load_array(path) for name, path in run["inputs"].items()}
    y = instance.run(RunRequest(**{**run, "t": load_array(run["t"]), "inputs": inputs}))
    if y is None:
        return None
    results = open_results(folder, y.shape)
    results[:] = y
    return str(results.filename)


if __name__ == "__main__":
    RequestServer().serve(lambda request: run_request(**request))
