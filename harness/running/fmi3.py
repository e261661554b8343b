"""Runs FMI 3.0 FMUs of this project through fmpy.

Co-simulation uses the solver of the FMU. Model exchange uses fmpy's CVode: BDF with finite-difference Jacobians; the
absolute tolerance is the relative one times the nominal values of the FMU. fmpy limits CVode to 500 steps between two
output points. Where static friction does not exceed sliding friction, CVode misses reversals that only touch v = 0.
"""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.simulation import Input

from ..errors import HarnessError, first_line
from ..process.interrupt import check_interrupt
from .description import read_description
from .unpacking import unpack

MODEL_EXCHANGE, CO_SIMULATION = "ModelExchange", "CoSimulation"
EVALUATIONS = "solver.evaluations"  # of the FMU's own solver
# fmpy raises the messages that CVode would print
SUNDIALS_LOG_VARIABLES = ("SUNLOGGER_ERROR_FILENAME", "SUNLOGGER_WARNING_FILENAME")


class CountingModel(FMU3Model):
    """Model exchange instance that counts right-hand sides and can update its inputs whenever the time is set."""

    evaluations = 0
    driven_input: Any = None  # inputs to update with the time

    def setTime(self, time: float) -> None:
        super().setTime(time)
        if self.driven_input:
            self.driven_input.apply(time, after_event=True)

    def getContinuousStateDerivatives(self, derivatives: Any, size: int) -> None:
        self.evaluations += 1
        super().getContinuousStateDerivatives(derivatives, size)

    def reset(self) -> None:
        self.evaluations, self.driven_input = 0, None
        super().reset()


@dataclass(frozen=True)
class RecordedRun:
    """Outputs that fmpy recorded.

    Attributes
    ----------
    rows : numpy.ndarray
        Structured array of `time` in s and the outputs by name in SI units. Model exchange records a row before and one
        after each event.
    evaluations : int
        Evaluations of the right-hand side.
    """

    rows: np.ndarray
    evaluations: int

    def sample_at(self, times: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Return the named outputs, (n, names), at the recorded times nearest to `times` (n,) in s."""
        nearest = np.abs(self.rows["time"][:, None] - times).argmin(axis=0)
        return np.column_stack([self.rows[name][nearest] for name in names])

    def find_changes(self, name: str) -> list[tuple[float, int]]:
        """Return every change of an integer output as (time in s, new value)."""
        times, values = self.rows["time"], self.rows[name]
        after = np.flatnonzero(np.diff(values)) + 1
        return list(zip(times[after].tolist(), values[after].tolist(), strict=True))


@dataclass(frozen=True)
class Fmi3Instance:
    """Instance of an unpacked FMU that is reset after each run."""

    interface: str
    fmu: Any
    description: Any
    folder: str

    def simulate(
        self,
        values: dict[str, float],
        outputs: Sequence[str],
        stop: float,
        interval: float,
        rtol: float | None = None,
        timeout: float | None = None,
        start: float = 0.0,
        signals: np.ndarray | None = None,
        drive_inputs: bool = False,
    ) -> RecordedRun:
        """Run the FMU and record outputs.

        Parameters
        ----------
        values : dict
            Values to set before the run, by variable name.
        outputs : sequence of str
            Variables to record.
        start, stop, interval : float
            Start, stop and output interval in s.
        rtol : float, optional
            Relative tolerance; by default that of the FMU's default experiment.
        timeout : float, optional
            Time limit of the run in s.
        signals : numpy.ndarray, optional
            Structured array of `time` and inputs, interpolated linearly. A repeated time is a jump.
        drive_inputs : bool
            Whether inputs follow the signals at every evaluation; otherwise fmpy holds them during each solver step.

        Raises
        ------
        HarnessError
            If the run fails or exceeds `timeout`.
        """
        if drive_inputs:
            self.fmu.driven_input = Input(self.fmu, self.description, signals)
        try:
            rows = fmpy.simulate_fmu(
                self.folder,
                fmi_type=self.interface,
                start_time=start,
                stop_time=stop,
                output_interval=interval,
                relative_tolerance=rtol,
                start_values=values,
                input=signals,
                output=[*outputs, EVALUATIONS],
                timeout=timeout,
                model_description=self.description,
                fmu_instance=self.fmu,
                step_finished=check_status,
            )
        except RuntimeError as error:  # the path of CVode's source precedes its message
            message = str(error).rpartition(": ")[2]
            raise HarnessError(f"fmpy's CVode (500 steps from point to point at most): {message}") from None
        end = rows["time"][-1]
        if end < stop - 0.5 * interval:
            raise HarnessError(f"at t = {end:.3g} s" + (f" after {timeout:g} s of run time" if timeout else ""))
        evaluations = self.fmu.evaluations if self.interface == MODEL_EXCHANGE else int(rows[EVALUATIONS][-1])
        self.fmu.reset()
        return RecordedRun(rows, evaluations)


def check_status(time: float, recorder: Any) -> bool:
    """Continue the run, unless a signal was received: callbacks of CVode swallow its exception."""
    check_interrupt()
    return True


def fmi3_path(fmu: Path) -> Path:
    """Return the path of the native FMI 3.0 FMU of the same model."""
    return fmu.parent / "native" / "fmi3" / fmu.name


@contextmanager
def open_fmi3_instance(file: Path, interface: str) -> Iterator[Fmi3Instance]:
    """Unpack and instantiate an FMU; free the instance and remove the files on exit.

    Raises
    ------
    HarnessError
        With the FMU's own message, or fmpy's, if anything fails.
    """
    if not file.is_file():
        raise HarnessError(f"not built: {file} (python build_fmus.py --fmi 3)")
    os.environ |= dict.fromkeys(SUNDIALS_LOG_VARIABLES, os.devnull)
    logged: list[str] = []

    def log_message(environment: Any, status: int, category: bytes, message: bytes) -> None:
        logged.append(message.decode(errors="replace"))

    try:
        with unpack(file) as folder:
            description = read_description(file)
            fmu = (CountingModel if interface == MODEL_EXCHANGE else FMU3Slave)(
                guid=description.guid, unzipDirectory=str(folder), modelIdentifier=file.stem, instanceName=file.stem
            )
            fmu.instantiate(loggingOn=True, logMessage=log_message)
            try:
                yield Fmi3Instance(interface, fmu, description, str(folder))
            finally:
                fmu.freeInstance()
    except Exception as error:  # fmpy raises bare Exceptions, and those of zip and XML readers
        if isinstance(error, HarnessError) and not logged:
            raise
        raise HarnessError(logged[-1] if logged else f"{file.name}: {first_line(error)}") from None
