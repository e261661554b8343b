"""Child process that runs an external FMU: reads a request from standard input, writes rows and a result to files."""

import faulthandler
import json
import os
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

import fmpy
from fmpy.fmi1 import FMICallException

from ...errors import HarnessError, first_line
from ..inputs import InputSignals
from .cosimulation import cosimulate
from .instance import MESSAGES, STATUS_NAMES, initialize, instantiate, last_error_message, trim_messages
from .model_exchange import integrate
from .refinement_run import RefinementRun, StepRefusedError, TerminatedError, TimeGrid
from .request import (
    OUTPUT_FILE,
    PROGRESS_FILE,
    RESULT_FILE,
    ROWS_PREFIX,
    STRINGS_FILE,
    TIMEOUT_FILE,
    ExternalRunRequest,
    RefinementResult,
)
from .sample_rows import RowRecorder, StringTable, read_rows
from .step_refinement import refine

REPORT_INTERVAL = 0.2  # s between progress reports
MAX_OUTPUT_BYTES = 1_000_000  # of FMU output that are kept
REMAINING_SHARE = 0.8  # of the progress bar after each run


class Watchdog:
    """Reports progress and ends the process if one FMI call takes longer than the timeout."""

    def __init__(self, directory: Path, timeout: float) -> None:
        self.timeout_file, self.progress_file = (
            (directory / TIMEOUT_FILE).open("w"),
            (directory / PROGRESS_FILE).open("w"),
        )
        self.timeout, self.next, self.progress, self.n_runs = timeout, 0.0, 0.0, 0
        self.parent = os.getppid()

    def report_progress(self, progress: float | None = None) -> None:
        """Report the progress of the present run, from 0 to 1, and reset the watchdog.

        The number of runs is unknown: each run takes a fixed share of what remains of the progress bar.
        """
        now = perf_counter()
        if now < self.next:
            return
        self.next = now + REPORT_INTERVAL
        if os.getppid() != self.parent:  # the parent was killed
            os._exit(1)
        faulthandler.dump_traceback_later(self.timeout, exit=True, file=self.timeout_file)
        self.progress = self.progress if progress is None else progress
        self.progress_file.seek(0)
        self.progress_file.write(f"{1 - REMAINING_SHARE ** (self.n_runs + self.progress):.6f}")
        self.progress_file.flush()
        trim_messages()
        if os.fstat(1).st_size > MAX_OUTPUT_BYTES:
            os.ftruncate(1, 0)


class ExternalFmu:
    """Runs an external FMU, each time with a new instance."""

    def __init__(self, request: ExternalRunRequest, directory: Path, watchdog: Watchdog) -> None:
        self.request, self.directory, self.watchdog = request, directory, watchdog
        self.description = fmpy.read_model_description(request.folder, validate=False)
        variables = {variable.name: variable for variable in self.description.modelVariables}
        self.variables = [(variables[name], tuple(shape)) for name, shape in request.outputs.items()]
        self.strings = StringTable(directory / STRINGS_FILE)

    def run(self, h: float, tolerance: float) -> RefinementRun:
        """Run the FMU with a communication step in s and a tolerance."""
        number = self.watchdog.n_runs
        path = self.directory / f"{ROWS_PREFIX}{number}"
        del MESSAGES[:]
        self.watchdog.next = 0.0
        self.watchdog.report_progress(0.0)
        cause: Exception | None = None
        try:
            self.step(path, h, tolerance)
        except FMICallException as error:
            status = dict(enumerate(STATUS_NAMES)).get(error.status, error.status)
            cause = HarnessError(f"{error.function} returned {status}")
        except Exception as error:  # fmpy raises bare Exceptions
            cause = error
        message = first_line(cause) if cause else ""
        path.touch()
        rows = read_rows(path, self.variables)
        for older in self.directory.glob(f"{ROWS_PREFIX}*") if not message else ():
            if older != path:
                older.unlink()  # superseded by a complete run
        if message:
            where = f" at t = {rows.time[-1]:.9g} s" if len(rows.time) and " at t = " not in message else ""
            message = ": ".join(filter(None, (message + where, last_error_message())))
        self.watchdog.n_runs += 1
        return RefinementRun(
            number, rows, message, isinstance(cause, TerminatedError), isinstance(cause, StepRefusedError)
        )

    def step(self, path: Path, h: float, tolerance: float) -> None:
        """Run a new instance and record its rows; exceptions propagate."""
        request, description = self.request, self.description
        fmu = instantiate(description, request.folder, request.exchange)
        initialize(fmu, description, request.values, request.start, request.stop, tolerance)
        record = RowRecorder(fmu, description.fmiVersion, self.variables, path, self.strings).record
        times, report_progress = TimeGrid(request.start, request.stop, h), self.watchdog.report_progress
        signals = self.input_signals(fmu)
        try:
            if request.exchange:
                integrate(fmu, description, times, tolerance, record, report_progress, signals)
            else:
                cosimulate(fmu, description.fmiVersion, times, record, report_progress, signals)
        except (TerminatedError, StepRefusedError):
            # after any other failure the next call may crash; the exit frees the instance
            fmu.freeInstance()
            raise
        with suppress(FMICallException):  # all results are recorded
            fmu.terminate()
        fmu.freeInstance()

    def input_signals(self, fmu: Any) -> InputSignals | None:
        """Return what sets the inputs of an instance, None if the run has no input signals."""
        inputs = self.request.inputs
        variables = {variable.name: variable for variable in self.description.modelVariables}
        if not inputs:
            return None
        kinds = {variables[name].type for name in inputs if name in variables}
        if len(kinds) > 1:
            raise HarnessError(f"inputs of several types ({', '.join(sorted(kinds))}) cannot be driven at once")
        return InputSignals(inputs, getattr(fmu, f"set{kinds.pop()}"), variables)


def main() -> None:
    """Handle one request."""
    request = ExternalRunRequest(**json.load(sys.stdin))
    directory = Path(request.directory)
    output = os.open(directory / OUTPUT_FILE, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for stream in (1, 2):  # redirect output of the FMU
        os.dup2(output, stream)
    watchdog = Watchdog(directory, request.timeout)
    watchdog.report_progress(0.0)
    try:
        external_fmu = ExternalFmu(request, directory, watchdog)
        result = refine(request, external_fmu.description, external_fmu.run)
    except Exception as error:
        result = RefinementResult(None, "", first_line(error))
    temporary_file = directory / f"{RESULT_FILE}.new"
    temporary_file.write_text(json.dumps(asdict(result)), encoding="utf-8")
    temporary_file.rename(directory / RESULT_FILE)
    os._exit(0)  # an FMU that has failed may crash when its library is unloaded


if __name__ == "__main__":
    main()
