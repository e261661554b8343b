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


def run_request(
    fmu: str, settings: dict[str, Any], limit: float, run: dict[str, Any] | None, results: str = ""
) -> bool:
    """Run an FMU, or load it if there is no run, and return whether the results were written."""
    instance = open_run(fmu, tuple(settings.items()), limit)
    if run is None:
        return False
    inputs = {name: load_array(path) for name, path in run["inputs"].items()}
    y = instance.run(RunRequest(**{**run, "t": load_array(run["t"]), "inputs": inputs}))
    if y is not None:
        np.save(results, y)
    return y is not None


if __name__ == "__main__":
    RequestServer().serve(lambda request: run_request(**request))
