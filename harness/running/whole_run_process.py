"""Child process for runs of an external FMU. Specifications are read from files, and results written to files."""

import json
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from ..process.child_process import RequestServer
from ..scenes.run_spec import RunSpec
from .whole_run import PreparedRun, RunSession

MAX_PREPARED = 64  # runs in the cache


@cache
def open_session(fmu: Path, limit: float) -> RunSession:
    """Return the session of an FMU, with a limit of the processor time of a run in s."""
    return RunSession(fmu, limit)


@lru_cache(MAX_PREPARED)
def prepare_run(path: str) -> PreparedRun:
    """Return the run whose specification is in a file."""
    spec = RunSpec.from_json(json.loads(Path(path).read_text(encoding="utf-8")))
    return PreparedRun(spec, open_session(spec.fmu, spec.timeout))


@lru_cache(MAX_PREPARED)
def open_results(folder: Path, shape: tuple[int, ...]) -> np.memmap:
    """Return an array in a file, into which all results of this shape are written."""
    return np.lib.format.open_memmap(folder / f"y{shape}.npy", "w+", float, shape)


def load(fmu: str, limit: float) -> None:
    """Load an FMU."""
    open_session(Path(fmu), limit)


def run(spec: str, values: dict[str, float]) -> str | None:
    """Run the specification in a file with other values; return the file of the results, None if there are none."""
    y = prepare_run(spec).run(values)
    if y is None:
        return None
    results = open_results(Path(spec).parent, y.shape)
    results[:] = y
    return str(results.filename)


if __name__ == "__main__":
    RequestServer().serve(lambda request: run(**request) if "spec" in request else load(**request))
