"""Runs any FMU: one of this project in a session, an external one with step refinement (external/simulation.py)."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import HarnessError, SceneError, check_names
from ..scenes.run_spec import RunSpec
from .fmu_archive import REQUIRED_VARIABLES, exposes_solver_steps, read_description, unpack
from .fmu_instance import FmuInstance, LogCapture, capture_stderr
from .recorder import default_outputs
from .session import QUIET, ProgressCallback, Session
from .stepping import POINT_TOLERANCE
from .trajectory import Trajectory

if TYPE_CHECKING:
    from .external.simulation import ChildSession

DEFAULT_COMMUNICATION_STEPS = 512  # of a run without a communication step of its own


def run(spec: RunSpec, report: ProgressCallback) -> Trajectory:
    """Run an FMU as specified; without outputs in the specification, record all of them.

    Parameters
    ----------
    spec : RunSpec
    report : callable
        Receives the progress of the run, from 0 to 1.

    Raises
    ------
    SceneError
        If the specification is not valid.
    HarnessError
        If the run fails and there is nothing to show.
    """
    if len(spec.times) and spec.interval is not None:
        raise SceneError("times and interval exclude each other: remove one")
    description = read_description(spec.fmu, spec.lenient)
    spec = replace(spec, outputs=spec.outputs or default_outputs(description, spec.values))
    if not spec.outputs:
        raise HarnessError(f"{spec.fmu.name} has no outputs or locals to record")
    with open_session(spec) as session:
        trajectory = session.run(report=report)
    if len(spec.times):
        return keep_times(trajectory, np.asarray(spec.times, dtype=float))
    return trajectory if spec.interval is None else keep_interval(trajectory, spec.interval)


def keep_times(run: Trajectory, times: np.ndarray) -> Trajectory:
    """Keep the points of a run nearest to times in s, after an event there; the last one if it ends before them all."""
    reached_times = times[times <= run.time[-1] + POINT_TOLERANCE * (run.time[-1] - run.time[0])]
    before = np.searchsorted(run.time, reached_times, "right") - 1
    after = np.minimum(before + 1, len(run.time) - 1)
    rows = np.where(run.time[after] - reached_times < reached_times - run.time[before], after, before)
    return keep_rows(run, rows if len(rows) else np.array([len(run.time) - 1]))


def keep_interval(run: Trajectory, interval: float) -> Trajectory:
    """Keep one point of a run at each multiple of an interval in s, after an event there, and its last one."""
    start = run.time[0]
    multiples = np.rint((run.time - start) / interval)
    distances = np.abs(start + multiples * interval - run.time)
    near = np.flatnonzero(distances <= POINT_TOLERANCE * interval)
    order = near[np.lexsort((-near, distances[near], multiples[near]))]  # of points as near as another, the last
    rows = order[np.unique(multiples[order], return_index=True)[1]]
    return keep_rows(run, np.union1d(rows, len(run.time) - 1))


def keep_rows(run: Trajectory, rows: np.ndarray) -> Trajectory:
    """Keep rows of a run, given by indices or by one Boolean for each."""
    return replace(run, time=run.time[rows], columns={name: column[rows] for name, column in run.columns.items()})


def run_own_fmu(spec: RunSpec, report: ProgressCallback = QUIET) -> Trajectory:
    """Run an FMU of this project as specified; with `exchange`, `tolerance` is that of the solver.

    Parameters
    ----------
    spec : RunSpec
    report : callable
        Receives the progress of the run, from 0 to 1.

    Raises
    ------
    SceneError
        If the specification names variables or values that the FMU does not have.
    HarnessError
        If the run fails, with the message of the FMU.
    """
    with open_instance(spec) as instance:
        return Session(instance, spec).run(report=report)


def runs_in_process(spec: RunSpec) -> bool:
    """Return whether an FMU runs in this process: one of this project, for co-simulation."""
    return exposes_solver_steps(read_description(spec.fmu, spec.lenient)) and not spec.exchange


@contextmanager
def open_session(
    spec: RunSpec, varied_names: Sequence[str] = (), read_names: Sequence[str] = ()
) -> "Iterator[Session | ChildSession]":
    """Open the session of a run: in this process, or in a worker if the FMU is external.

    Parameters
    ----------
    spec : RunSpec
    varied_names : sequence of str
        Variables whose values differ from run to run.
    read_names : sequence of str
        Variables that are read at the end of runs in this process.
    """
    if runs_in_process(spec):
        with open_instance(spec) as instance:
            yield Session(instance, spec, varied_names, read_names)
    else:
        from .external.simulation import ChildSession

        with ChildSession(spec, read_description(spec.fmu, spec.lenient), varied_names) as session:
            yield session


def read_own_description(fmu: Path, exchange: bool = False) -> Any:
    """Return the model description of an FMU of this project.

    Raises
    ------
    HarnessError
        If it cannot be read or does not offer the interface.
    SceneError
        If it is not an FMU of this project.
    """
    description = read_description(fmu)
    if (description.modelExchange if exchange else description.coSimulation) is None:
        raise HarnessError(f"{fmu.name} offers no {'model exchange' if exchange else 'co-simulation'}")
    names = {variable.name for variable in description.modelVariables}
    for name in REQUIRED_VARIABLES:
        if name not in names:
            raise SceneError(f"{fmu.name} has no variable {name}: it is not an FMU of this project")
    return description


@contextmanager
def open_instance(spec: RunSpec, unpacked_folder: Path | None = None) -> Iterator[FmuInstance]:
    """Instantiate an FMU, unpacked in a temporary directory or before; capture its messages."""
    description = read_own_description(spec.fmu, spec.exchange)
    readable = [item.name for item in description.modelVariables if item.causality in ("output", "local")]
    check_names("output", spec.outputs, readable)
    with ExitStack() as stack:
        folder = unpacked_folder or stack.enter_context(unpack(spec.fmu))
        log = LogCapture(stack.enter_context(capture_stderr()))
        try:
            instance = FmuInstance(description, folder, spec.exchange, spec.model, log)
        except HarnessError as error:
            raise HarnessError(f"{spec.fmu.name} cannot be loaded: {error}") from None
        stack.callback(instance.close)
        yield instance
