"""Run of an external FMU in a worker process, which writes rows to files, so that they survive a crash."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from fmpy.fmi1 import FMICallException

from ...errors import HarnessError, first_line
from ...scenes.run_spec import RunSpec
from ..event_mode import Clocks, EventCoSimulation
from ..fmu_archive import read_leniently
from ..fmu_instance import (
    STATUS_NAMES,
    FmuInstance,
    LogCapture,
    StepError,
    StepRefusedError,
    TerminatedError,
)
from ..model_exchange import ModelExchange
from ..recorder import Recorder, StringTable, read_rows, select_variables
from ..stepping import CoSimulation, Stepper, input_signals, make_grid, step_to_stop
from .step_refinement import (
    ROWS_PREFIX,
    STRINGS_FILE,
    RefinementResult,
    RefinementRun,
    coarsest_grid,
    refine,
)

REMAINING_SHARE = 0.8  # share of the rest of the progress bar that a run leaves


class ExternalFmu:
    """Runs an external FMU, with a new instance for each run.

    Parameters
    ----------
    spec : RunSpec
        The run, with its start, stop and converted values.
    folder : pathlib.Path
        Directory of the unpacked FMU.
    directory : pathlib.Path
        Directory for results.
    report : callable
        Receives the progress from 0 to 1 and a note. The parent kills this process if one FMI call takes longer than
        its timeout.
    """

    def __init__(self, spec: RunSpec, folder: Path, directory: Path, report: Callable[[float, str], None]) -> None:
        self.spec, self.folder, self.directory = spec, folder, directory
        self.description = read_leniently(folder)
        variables = {variable.name: variable for variable in self.description.modelVariables}
        self.settings = [(variables[name], value) for name, value in spec.values.items()]
        self.selection = select_variables(spec, variables, spec.values)
        self.strings, self.report = StringTable(directory / STRINGS_FILE), report
        self.n_runs, self.progress, self.note = 0, 0.0, ""

    def report_progress(self, progress: float | None = None) -> None:
        """Report the progress of the current run, from 0 to 1, or that the process works.

        The number of runs is not known in advance, so each run takes a fixed share of the rest of the progress bar.
        """
        self.progress = self.progress if progress is None else progress
        self.report(1 - REMAINING_SHARE ** (self.n_runs + self.progress), self.note)

    def show(self, note: str) -> None:
        """Show the current accuracy beside the progress."""
        self.note = note

    def run(self, h: float, tolerance: float) -> RefinementRun:
        """Run the FMU with a communication step in s and a tolerance."""
        number, log = self.n_runs, LogCapture()
        path = self.directory / f"{ROWS_PREFIX}{number}"
        self.report_progress(0.0)
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
        time, columns = read_rows(path.read_bytes(), self.selection, self.description.fmiVersion == "2.0")
        for file in self.directory.glob(f"{ROWS_PREFIX}*") if not message else ():
            if file != path:
                file.unlink()  # superseded by a complete run
        if message:
            time_text = f" at t = {time[-1]:.9g} s" if len(time) and " at t = " not in message else ""
            message = ": ".join(filter(None, (message + time_text, log.error_message)))
        self.n_runs += 1
        is_terminated, is_step_refused = isinstance(cause, TerminatedError), isinstance(cause, StepRefusedError)
        return RefinementRun(number, time, columns, message, is_terminated, is_step_refused)

    def record(self, path: Path, log: LogCapture, h: float, tolerance: float) -> None:
        """Run a new instance and record its rows; exceptions propagate."""
        span = coarsest_grid(self.spec)
        grid = make_grid(replace(self.spec, grid=h), span.start, span.stop)
        instance = FmuInstance(self.description, self.folder, self.spec.exchange, log=log, ticks_clocks=True)
        instance.enter_initialization(self.settings, grid.start, grid.stop, tolerance)
        clocks = Clocks(instance, self.folder, grid.start, grid.tolerance) if instance.ticks_clocks else None
        instance.fmu.exitInitializationMode()
        signals = input_signals(self.spec, instance)
        stepper: Stepper
        if self.spec.exchange:
            stepper = ModelExchange(instance, grid, tolerance, self.report_progress, signals, clocks=clocks)
        elif clocks:
            stepper = EventCoSimulation(instance, grid, clocks, signals)
        else:
            stepper = CoSimulation(instance, grid, signals, only_grid=True)
        with path.open("wb", buffering=0) as file:
            recorder = Recorder(instance, self.selection, file.write, self.strings, only_finite=True)
            if clocks:
                clocks.read_values = recorder.read_clocked
            try:
                step_to_stop(stepper, grid, recorder.record, self.report_progress)
            except StepError:  # after any other failure the next call may crash; the exit frees the instance
                instance.close()
                raise
        with suppress(FMICallException):  # all results are recorded
            instance.fmu.terminate()
        instance.close()


def run_unpacked_fmu(
    spec: RunSpec, folder: Path, directory: Path, report: Callable[[float, str], None]
) -> RefinementResult:
    """Run an FMU that is unpacked in a folder, and write rows into a directory."""
    try:
        fmu = ExternalFmu(spec, folder, directory, report)
        return refine(fmu.spec, fmu.description, fmu.run, fmu.show)
    except Exception as error:
        return RefinementResult(None, "", first_line(error))
