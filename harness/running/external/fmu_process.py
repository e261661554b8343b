"""The process that holds the FMU: reads a request on standard input, and leaves rows and an answer in the room."""

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

REPORT_INTERVAL = 0.2  # s between two signs of life
MAX_OUTPUT_BYTES = 1_000_000  # bytes of what the FMU prints that are kept
REMAINING_SHARE = 0.8  # of the bar that shows the progress, after each pass


class Watchdog:
    """Tells from time to time that this process is alive; while it does not, a watchdog runs."""

    def __init__(self, room: Path, timeout: float) -> None:
        self.timeout_file, self.progress_file = (room / TIMEOUT_FILE).open("w"), (room / PROGRESS_FILE).open("w")
        self.timeout, self.next, self.progress, self.n_runs = timeout, 0.0, 0.0, 0
        self.parent = os.getppid()

    def report_progress(self, share: float | None = None) -> None:
        """So far is the pass, as a share of it; how many there will be nobody knows."""
        now = perf_counter()
        if now < self.next:
            return
        self.next = now + REPORT_INTERVAL
        if os.getppid() != self.parent:  # it was killed, and nobody waits
            os._exit(1)
        faulthandler.dump_traceback_later(self.timeout, exit=True, file=self.timeout_file)
        self.progress = self.progress if share is None else share
        self.progress_file.seek(0)
        self.progress_file.write(f"{1 - REMAINING_SHARE ** (self.n_runs + self.progress):.6f}")
        self.progress_file.flush()
        trim_messages()
        if os.fstat(1).st_size > MAX_OUTPUT_BYTES:
            os.ftruncate(1, 0)


class ExternalFmu:
    """Runs the FMU pass by pass, each on an instance of its own."""

    def __init__(self, asked: ExternalRunRequest, room: Path, life: Watchdog) -> None:
        self.request, self.directory, self.life = asked, room, life
        self.description = fmpy.read_model_description(asked.folder, validate=False)
        variables = {variable.name: variable for variable in self.description.modelVariables}
        self.variables = [(variables[name], tuple(shape)) for name, shape in asked.outputs.items()]
        self.strings = StringTable(room / STRINGS_FILE)

    def run(self, h: float, tolerance: float) -> RefinementRun:
        """One pass with a communication step in s and a tolerance."""
        number = self.life.n_runs
        path = self.directory / f"{ROWS_PREFIX}{number}"
        del MESSAGES[:]
        self.life.next = 0.0
        self.life.report_progress(0.0)
        why: Exception | None = None
        try:
            self.step(path, h, tolerance)
        except FMICallException as error:
            status = dict(enumerate(STATUS_NAMES)).get(error.status, error.status)
            why = HarnessError(f"{error.function} answered {status}")
        except Exception as error:  # fmpy raises bare Exceptions
            why = error
        sentence = first_line(why) if why else ""
        path.touch()
        rows = read_rows(path, self.variables)
        for older in self.directory.glob(f"{ROWS_PREFIX}*") if not sentence else ():
            if older != path:
                older.unlink()  # nobody needs it beside one that is whole
        if sentence:
            at = f" at t = {rows.time[-1]:.9g} s" if len(rows.time) and " at t = " not in sentence else ""
            sentence = ": ".join(filter(None, (sentence + at, last_error_message())))
        self.life.n_runs += 1
        return RefinementRun(
            number, rows, sentence, isinstance(why, TerminatedError), isinstance(why, StepRefusedError)
        )

    def step(self, path: Path, h: float, tolerance: float) -> None:
        """The same; whatever ends it is raised."""
        asked, found = self.request, self.description
        fmu = instantiate(found, asked.folder, asked.exchange)
        initialize(fmu, found, asked.values, asked.start, asked.stop, tolerance)
        sample = RowRecorder(fmu, found.fmiVersion, self.variables, path, self.strings).record
        signals = self.input_signals(fmu)
        span, heed = TimeGrid(asked.start, asked.stop, h), self.life.report_progress
        try:
            if asked.exchange:
                integrate(fmu, found, span, tolerance, sample, heed, signals)
            else:
                cosimulate(fmu, found.fmiVersion, span, sample, heed, signals)
        except (
            TerminatedError,
            StepRefusedError,
        ):  # what has failed may crash in whatever is called next: the process's end frees it
            fmu.freeInstance()
            raise
        with suppress(FMICallException):  # all that was wanted is there
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
    """Answer one request."""
    asked = ExternalRunRequest(**json.load(sys.stdin))
    room = Path(asked.directory)
    said = os.open(room / OUTPUT_FILE, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for stream in (1, 2):  # whatever the FMU prints
        os.dup2(said, stream)
    life = Watchdog(room, asked.timeout)
    life.report_progress(0.0)
    try:
        host = ExternalFmu(asked, room, life)
        answer = refine(asked, host.description, host.run)
    except Exception as error:
        answer = RefinementResult(None, "", first_line(error))
    written = room / f"{RESULT_FILE}.new"
    written.write_text(json.dumps(asdict(answer)), encoding="utf-8")
    written.rename(room / RESULT_FILE)
    os._exit(0)  # an FMU that has failed may crash when its library is unloaded


if __name__ == "__main__":
    main()
