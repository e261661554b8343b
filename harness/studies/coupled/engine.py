"""Engines that run an SSP archive, each in a process of its own."""

from collections.abc import Callable, Sequence

from ...errors import HarnessError, install_command
from ...process.worker import WorkerCallError, WorkerDiedError, call_once
from ...running import ssp
from . import ecos, libcosim, master
from .system import (
    BOUND,
    ELEMENTS,
    EXCHANGE,
    MAPPED,
    NESTED,
    OUTER_VALUES,
    TRANSFORMED,
    UNITS,
    VERSION_2,
    ElementVariable,
)

ENGINE_TIMEOUT = 300.0  # s, for one run
EXTRA = "coupled"
MAIN_ENGINE = "Ecos"
ENGINES: dict[str, Callable[[ssp.ArchiveRun, Sequence[ElementVariable], str], list[list[float]]]] = {
    "own master": master.run_archive,
    "Ecos": ecos.run_archive,
    "libcosim": libcosim.run_archive,
    "fmpy": ssp.run_archive,
}
UNSUPPORTED = {  # with these features an engine fails, or ignores them without a message (measured)
    "Ecos": {NESTED, UNITS, MAPPED, OUTER_VALUES, VERSION_2, EXCHANGE, ELEMENTS},
    "libcosim": {NESTED, UNITS, MAPPED, OUTER_VALUES, EXCHANGE, ELEMENTS},
    "fmpy": {TRANSFORMED, UNITS, BOUND, OUTER_VALUES, VERSION_2, EXCHANGE, ELEMENTS},
}


def run_engine(
    engine: str, run: ssp.ArchiveRun, variables: Sequence[ElementVariable], parameter_set: str = ""
) -> list[list[float]]:
    """Run an archive and return one row per communication point, without the start if the engine does not record it.

    Parameters
    ----------
    engine : str
        Name of the engine, a key of ENGINES.
    run : ArchiveRun
        The archive, communication step, stop, and names of the variables.
    variables : sequence of ElementVariable
        Element, name and value reference of each variable, by which engines address it.
    parameter_set : str
        Name of the parameter set in the archive; empty for none.

    Raises
    ------
    HarnessError
        If the engine fails or times out; the message has the last line of its output.
    """
    failed = f"{engine} could not run {run.archive.name}"
    try:
        rows: list[list[float]] = call_once(ENGINES[engine], run, variables, parameter_set, timeout=ENGINE_TIMEOUT)
    except (WorkerCallError, WorkerDiedError) as error:
        hint = f"; {install_command(EXTRA)}" if "ModuleNotFoundError" in error.last_line else ""
        raise HarnessError(f"{failed}: {error.last_line}{hint}") from None
    except HarnessError as error:
        raise HarnessError(f"{failed}: {error}") from None
    return rows
