"""Engines that run an SSP archive, each in a separate process with JSON input and output."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from ...errors import HarnessError
from ...process.subprocess_runner import SubprocessTimeoutError, run_module

ENGINE_TIMEOUT = 300.0  # s, for one run
EXTRA = "python -m pip install 'friction-fmus[coupled]'"
MAIN_ENGINE = "Ecos"
ENGINES = {  # modules
    "Ecos": f"{__package__}.ecos",
    "libcosim": f"{__package__}.libcosim",
    "fmpy": "harness.running.ssp",
}


@dataclass(frozen=True)
class EngineRequest:
    """Run an archive with `count` communication steps of `step` s and the parameter set `values`, and read variables
    (element, variable, value reference) after each step."""

    archive: str
    step: float
    count: int
    read: list[tuple[str, str, int]]
    values: str = "initialValues"


def run_engine(engine: str, request: EngineRequest) -> list[list[float]]:
    """Run an archive and return one row per communication point, without the start if the engine does not record it.

    Raises
    ------
    HarnessError
        If the engine fails or times out; with its last line of output.
    """
    failed = f"{engine} could not run {Path(request.archive).name}"
    try:
        process = run_module(ENGINES[engine], json.dumps(asdict(request)), timeout=ENGINE_TIMEOUT)
    except SubprocessTimeoutError as timeout:
        raise HarnessError(f"{failed}: {timeout}") from None
    if process.returncode or not process.stdout:
        last = (process.stderr.strip().splitlines() or [f"exit status {process.returncode}"])[-1]
        hint = f"; {EXTRA}" if "ModuleNotFoundError" in last else ""
        raise HarnessError(f"{failed}: {last}{hint}")
    rows: list[list[float]] = json.loads(process.stdout)
    return rows
