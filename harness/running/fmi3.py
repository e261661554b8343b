"""Runs a built FMI 3.0 FMU through fmpy, both ways; the only file that knows fmpy's FMI 3.0.

Co-simulation: the FMU's own solver.  Model exchange: fmpy's CVode (BDF with Jacobians by differences, the absolute
tolerance being the relative one times the FMU's nominals).  fmpy lets it take 500 steps from one point to the next,
and where friction at rest is no more than sliding friction it does not see a turn that only touches v = 0.
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
SUNDIALS_LOG_VARIABLES = (
    "SUNLOGGER_ERROR_FILENAME",
    "SUNLOGGER_WARNING_FILENAME",
)  # CVode would write what fmpy raises


class CountingModel(FMU3Model):
    """An instance for model exchange that counts its right-hand sides, and whose inputs can be led along."""

    evaluations = 0
    driven_input: Any = None  # the inputs that are

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
    """What fmpy recorded: `rows` is a structured array of `time` in s and the outputs by name (SI units), in model
    exchange with a row before and one after each event; and the right-hand sides evaluated."""

    rows: np.ndarray
    evaluations: int

    def sample_at(self, times: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """The outputs of those names, (n, names), at the recorded times nearest to n times in s."""
        nearest = np.abs(self.rows["time"][:, None] - times).argmin(axis=0)
        return np.column_stack([self.rows[name][nearest] for name in names])

    def find_changes(self, name: str) -> list[tuple[float, int]]:
        """Every change of an integer output, as (time in s, new value)."""
        times, values = self.rows["time"], self.rows[name]
        after = np.flatnonzero(np.diff(values)) + 1
        return list(zip(times[after].tolist(), values[after].tolist(), strict=True))


@dataclass(frozen=True)
class Fmi3Instance:
    """A live instance of the FMU in a folder, fresh before each run."""

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
        """A run from the start to the stop, recorded at every interval (all in s); without rtol that of the FMU's
        default experiment.  Inputs follow `signals`, a structured array of `time` and theirs, in straight lines and,
        where a time stands twice, jumps; `led` along wherever the solver looks, or held by fmpy within its steps.
        HarnessError if it fails or outlasts `timeout` s."""
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
        except RuntimeError as error:  # the path of CVode's source stands before its sentence
            sentence = str(error).rpartition(": ")[2]
            raise HarnessError(f"fmpy's CVode (500 steps from point to point at most): {sentence}") from None
        last = rows["time"][-1]
        if last < stop - 0.5 * interval:
            raise HarnessError(f"at t = {last:.3g} s" + (f" after {timeout:g} s of run time" if timeout else ""))
        evaluations = self.fmu.evaluations if self.interface == MODEL_EXCHANGE else int(rows[EVALUATIONS][-1])
        self.fmu.reset()
        return RecordedRun(rows, evaluations)


def check_status(time: float, recorder: Any) -> bool:
    """Go on, unless a signal has come: CVode's callbacks swallow what it raises."""
    check_interrupt()
    return True


def fmi3_path(fmu: Path) -> Path:
    """The FMI 3.0 FMU of the same model, beside that of FMI 2.0."""
    return fmu.parent / "native" / "fmi3" / fmu.name


@contextmanager
def open_fmi3_instance(file: Path, way: str) -> Iterator[Fmi3Instance]:
    """An instance of the FMU, its files and its library gone afterwards; HarnessError with the FMU's own sentence, or
    fmpy's, if something fails."""
    if not file.is_file():
        raise HarnessError(f"not built: {file} (python build_fmus.py --fmi 3)")
    os.environ |= dict.fromkeys(SUNDIALS_LOG_VARIABLES, os.devnull)
    said: list[str] = []

    def hear(environment: Any, status: int, category: bytes, message: bytes) -> None:
        said.append(message.decode(errors="replace"))

    try:
        with unpack(file) as folder:
            found = read_description(file)
            fmu = (CountingModel if way == MODEL_EXCHANGE else FMU3Slave)(
                guid=found.guid, unzipDirectory=str(folder), modelIdentifier=file.stem, instanceName=file.stem
            )
            fmu.instantiate(loggingOn=True, logMessage=hear)
            try:
                yield Fmi3Instance(way, fmu, found, str(folder))
            finally:
                fmu.freeInstance()
    except Exception as error:  # fmpy raises bare Exceptions, and those of zip and XML readers
        if isinstance(error, HarnessError) and not said:
            raise
        raise HarnessError(said[-1] if said else f"{file.name}: {first_line(error)}") from None
