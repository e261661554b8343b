"""Engines that run an SSP archive, each in a separate process with JSON input and output."""

from dataclasses import dataclass
from pathlib import Path

from ...errors import HarnessError
from ...process.child_process import ChildDiedError, ask_once

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
        rows: list[list[float]] = ask_once(ENGINES[engine], request, ENGINE_TIMEOUT)
    except ChildDiedError as died:
        hint = f"; {EXTRA}" if "ModuleNotFoundError" in died.last_line else ""
        raise HarnessError(f"{failed}: {died.last_line}{hint}") from None
    except HarnessError as error:
        raise HarnessError(f"{failed}: {error}") from None
    return rows
