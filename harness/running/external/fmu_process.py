"""Child process that runs an external FMU: it writes rows and progress to files and replies with a result."""

import os
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

import fmpy
from fmpy.fmi1 import FMICallException

from ...errors import HarnessError, first_line
from ...process.subprocess_runner import serve_request
from ...scenes.run_spec import RunSpec
from ..fmu_session import STATUS_NAMES, FmuSession, LogCapture, StepError, StepRefusedError, TerminatedError
from ..inputs import input_signals
from ..model_exchange import ModelExchange
from ..recorder import Recorder, StringTable, read_rows, select_variables
from ..stepping import CoSimulation, Stepper, TimeGrid, step_to_stop
from .step_refinement import (
    OUTPUT_FILE,
    PROGRESS_FILE,
    ROWS_PREFIX,
    STRINGS_FILE,
    RefinementRun,
    coarsest_grid,
    refine,
)

REPORT_INTERVAL = 0.2  # s between progress reports
MAX_OUTPUT_BYTES = 1_000_000  # of FMU output that are kept
REMAINING_SHARE = 0.8  # of the progress bar after each run


class ProgressFile:
    """Reports progress to the parent, which kills this process if one FMI call takes longer than its timeout."""

    def __init__(self, directory: Path) -> None:
        self.file, self.next, self.progress, self.n_runs = (directory / PROGRESS_FILE).open("w"), 0.0, 0.0, 0

    def report(self, progress: float | None = None) -> None:
        """Report the progress of the present run, from 0 to 1, or that the process works.

        The number of runs is unknown: each run takes a fixed share of what remains of the progress bar.
        """
        now = perf_counter()
        if now < self.next:
            return
        self.next = now + REPORT_INTERVAL
        self.progress = self.progress if progress is None else progress
        self.file.seek(0)
        self.file.write(f"{1 - REMAINING_SHARE ** (self.n_runs + self.progress):.6f}")
        self.file.flush()
        if os.fstat(1).st_size > MAX_OUTPUT_BYTES:
            os.ftruncate(1, 0)


class ExternalFmu:
    """Runs an external FMU, each time with a new instance.

    Parameters
    ----------
    spec : RunSpec
        The run, with its start, stop and converted values.
    folder : str
        Directory of the unpacked FMU.
    directory : pathlib.Path
        Directory for results.
    """

    def __init__(self, spec: RunSpec, folder: str, directory: Path) -> None:
        self.spec, self.folder, self.directory = spec, folder, directory
        self.description = fmpy.read_model_description(folder, validate=False)
        variables = {variable.name: variable for variable in self.description.modelVariables}
        self.settings = [(variables[name], value) for name, value in spec.values.items()]
        self.chosen = select_variables(spec, variables, spec.values)
        self.strings, self.progress = StringTable(directory / STRINGS_FILE), ProgressFile(directory)

    def run(self, h: float, tolerance: float) -> RefinementRun:
        """Run the FMU with a communication step in s and a tolerance."""
        number, log = self.progress.n_runs, LogCapture()
        path = self.directory / f"{ROWS_PREFIX}{number}"
        self.progress.next = 0.0
        self.progress.report(0.0)
        cause: Exception | None = None
        try:
            self.record(path, log, h, tolerance)
        except FMICallException as error:
            status = dict(enumerate(STATUS_NAMES)).get(error.status, error.status)
            cause = HarnessError(f"{error.function} returned {status}")
        except Exception as error:  # fmpy raises bare Exceptions
            cause = error
        message = first_line(cause) if cause else ""
        path.touch()
        time, columns = read_rows(path.read_bytes(), self.chosen, self.description.fmiVersion == "2.0")
        for older in self.directory.glob(f"{ROWS_PREFIX}*") if not message else ():
            if older != path:
                older.unlink()  # superseded by a complete run
        if message:
            where = f" at t = {time[-1]:.9g} s" if len(time) and " at t = " not in message else ""
            message = ": ".join(filter(None, (message + where, log.error_message)))
        self.progress.n_runs += 1
        terminated, step_refused = isinstance(cause, TerminatedError), isinstance(cause, StepRefusedError)
        return RefinementRun(number, time, columns, message, terminated, step_refused)

    def record(self, path: Path, log: LogCapture, h: float, tolerance: float) -> None:
        """Run a new instance and record its rows; exceptions propagate."""
        span = coarsest_grid(self.spec)
        grid = TimeGrid(span.start, span.stop, h)
        session = FmuSession(self.description, self.folder, self.spec.exchange, log=log)
        session.initialize(self.settings, grid.start, grid.stop, tolerance)
        signals = input_signals(self.spec.inputs, session)
        stepper: Stepper = (
            ModelExchange(session, grid, tolerance, self.progress.report, signals)
            if self.spec.exchange
            else CoSimulation(session, grid, signals, only_grid=True)
        )
        with path.open("wb", buffering=0) as file:
            recorder = Recorder(session, self.chosen, file.write, self.strings, only_finite=True)
            try:
                step_to_stop(stepper, grid, recorder.record, self.progress.report)
            except StepError:  # after any other failure the next call may crash; the exit frees the instance
                session.close()
                raise
        with suppress(FMICallException):  # all results are recorded
            session.fmu.terminate()
        session.close()


def run_request(run: dict[str, Any], folder: str, directory: str) -> dict[str, Any]:
    """Run an unpacked FMU; write rows and what the FMU prints into a directory, and return a RefinementResult."""
    output = os.open(Path(directory) / OUTPUT_FILE, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for stream in (1, 2):
        os.dup2(output, stream)
    try:
        fmu = ExternalFmu(RunSpec.from_json(run), folder, Path(directory))
        return asdict(refine(fmu.spec, fmu.description, fmu.run))
    except Exception as error:
        return {"run_number": None, "note": "", "failure": first_line(error)}


if __name__ == "__main__":
    serve_request(dict, lambda request: run_request(**request))
    os._exit(0)  # an FMU that has failed may crash when its library is unloaded
