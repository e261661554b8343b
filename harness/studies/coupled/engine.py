"""Engines that run an SSP archive, each in a process of its own: what they are asked and how they answer, in JSON."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from ...errors import HarnessError
from ...process.subprocess_runner import SubprocessTimeoutError, run_module

ENGINE_TIMEOUT = 300.0  # s, for one run
EXTRA = "python -m pip install 'friction-fmus[coupled]'"
MAIN_ENGINE = "Ecos"
ENGINES = {  # module of each
    "Ecos": f"{__package__}.ecos",
    "libcosim": f"{__package__}.libcosim",
    "fmpy": "harness.running.ssp",
}


@dataclass(frozen=True)
class EngineRequest:
    """Run an archive in so many (`count`) equal communication steps of `step` s, with a set of `values` in it, and read
    after each some variables: element, variable, value reference."""

    archive: str
    step: float
    count: int
    read: list[tuple[str, str, int]]
    values: str = "initialValues"


def run_engine(engine: str, asked: EngineRequest) -> list[list[float]]:
    """A row for each communication point, without the start where an engine does not show it; HarnessError with the
    last words of the engine if it gives none."""
    failed = f"{engine} could not run {Path(asked.archive).name}"
    try:
        done = run_module(ENGINES[engine], json.dumps(asdict(asked)), timeout=ENGINE_TIMEOUT)
    except SubprocessTimeoutError as late:
        raise HarnessError(f"{failed}: {late}") from None
    if done.returncode or not done.stdout:
        last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
        hint = f"; {EXTRA}" if "ModuleNotFoundError" in last else ""
        raise HarnessError(f"{failed}: {last}{hint}")
    found: list[list[float]] = json.loads(done.stdout)
    return found
