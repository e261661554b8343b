"""Runs of one FMU at the steps and events of its solver, and the comparison of two motions."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from math import ulp
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from harness.errors import HarnessError
from harness.scenes.run_spec import RunSpec
from harness.simulation.fmu_archive import read_description, unpack
from harness.simulation.fmu_instance import CALL_FAILURES, FmuInstance
from harness.simulation.recorder import default_outputs
from harness.simulation.session import Session
from harness.simulation.variable_values import enumeration_labels

from .changes import Change

N_SAMPLES = 64  # communication points at which states are compared
COUNTERS = ("steps", "rejected", "evaluations")  # of the statistics of a run
INTEGERS = ("Integer", "Int32", "Int64")


class TooManyStepsError(Exception):
    """A run exceeds its limit of steps; `share` is the part of the run that is done."""

    def __init__(self, share: float) -> None:
        super().__init__(f"it needs too many steps: {100 * share:.3g} % of the run is done")
        self.share = share


@dataclass(frozen=True)
class Motion:
    """A run: time (n,) in s and columns (n,) at all internal steps, changes of mode, counts of the solver.

    `event_times` (m,) are in s, `modes` (m, contacts) begin there; the first entry is the start. `failure` is the
    message of a run that fails.
    """

    time: np.ndarray
    columns: dict[str, np.ndarray]
    event_times: np.ndarray
    modes: np.ndarray
    counts: dict[str, int]
    failure: str = ""

    @classmethod
    def from_failure(cls, message: str) -> Self:
        """Return a motion without points."""
        return cls(np.zeros(0), {}, np.zeros(0), np.zeros((0, 0)), {}, message)


class FmuRuns:
    """Runs of one FMU in one instance, which is reset before each run and replaced after a failure.

    Attributes
    ----------
    variables : dict
        Variables of the model description by name.
    exponents : dict
        Exponents of mass, length and time of the unit of each Real.
    """

    def __init__(self, fmu: Path) -> None:
        self.fmu, self.description = fmu, read_description(fmu)
        self.variables: dict[str, Any] = {variable.name: variable for variable in self.description.modelVariables}
        units = {unit.name: unit.baseUnit for unit in self.description.unitDefinitions}
        self.exponents = {
            name: (unit.kg, unit.m, unit.s)
            for name, variable in self.variables.items()
            if (unit := units.get(variable.unit or getattr(variable.declaredType, "unit", None))) is not None
        }
        self.outputs = default_outputs(self.description)
        # sorted, because an FMU with another order of declarations has them in another order
        self.modes = sorted(name for name in self.outputs if self.variables[name].type in INTEGERS)
        self.stack = ExitStack()
        self.instance: FmuInstance | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance."""
        self.stack.close()
        self.instance = None

    def open(self) -> FmuInstance:
        """Return an instance that is not initialized."""
        if self.instance is None:
            folder = self.stack.enter_context(unpack(self.fmu))
            self.instance = FmuInstance(self.description, folder)
            self.stack.callback(self.instance.close)
        else:
            self.instance.reset()
        return self.instance

    @property
    def stop(self) -> float:
        """Return the default duration of a run in s."""
        return float(self.description.defaultExperiment.stopTime)

    def start_value(self, name: str) -> float:
        """Return the start value of a parameter or an input."""
        return float(self.variables[name].start)

    @property
    def methods(self) -> list[str]:
        """Return the integration methods."""
        return list(enumeration_labels(self.variables["solver.method"]).values())

    @property
    def default_method(self) -> str:
        """Return the integration method that the model chooses."""
        variable = self.variables["solver.method"]
        return enumeration_labels(variable)[int(variable.start)]

    def run(self, values: Mapping[str, Any], start: float, stop: float, max_steps: int) -> Motion:
        """Run with these values from start to stop in s.

        Raises
        ------
        TooManyStepsError
            If the run needs more than `max_steps`.
        """
        n_reports = 0

        def count_steps(share: float) -> None:
            nonlocal n_reports
            n_reports += 1
            if n_reports > max_steps:
                raise TooManyStepsError(share)

        extra = tuple(name for name in ("events.count", "events.t_last") if name in self.variables)
        spec = RunSpec(
            self.fmu,
            outputs=(*self.outputs, *extra),
            values=dict(values),
            start=start,
            stop=stop,
            grid=(stop - start) / N_SAMPLES,
        )
        try:
            trajectory = Session(self.open(), spec).run(report=count_steps)
        except (HarnessError, *CALL_FAILURES) as error:
            message = self.instance.log.error_message if self.instance else ""
            self.close()
            return Motion.from_failure(message or str(error))
        except TooManyStepsError:
            self.close()
            raise
        columns = trajectory.columns
        counts = {name: int(getattr(trajectory.statistics, name)) for name in COUNTERS}
        rows = np.zeros(1, dtype=int)
        if extra and trajectory.parameters.get("friction", "hybrid") == "hybrid":
            rows = np.append(rows, np.flatnonzero(np.diff(columns["events.count"])) + 1)
        return Motion(
            trajectory.time,
            {name: columns[name] for name in self.outputs},
            np.append(start, columns["events.t_last"][rows[1:]]) if extra else np.array([start]),
            np.array([[columns[name][row] for name in self.modes] for row in rows]),
            counts,
        )


def find_difference(base: Motion, changed_motion: Motion, change: Change, states: list[str], rtol: float) -> str:
    """Return the first difference between a motion and what it must be after a change; empty if there is none.

    Parameters
    ----------
    base, changed_motion : Motion
        The motion, and that after the change.
    change : Change
    states : list of str
        The states, which are compared if the bits may differ.
    rtol : float
        Relative tolerance of the method.
    """
    if changed_motion.failure:
        return f"fails: {changed_motion.failure}"
    times = change.map_time(base.event_times)
    n, n_changed = len(times) - 1, len(changed_motion.event_times) - 1
    counts = f"{n_changed} events instead of {n}" if n != n_changed else f"of {n} events"
    tolerance = 0.0
    if not change.is_exact:
        elapsed = np.maximum(base.event_times - base.event_times[0], 0.0)
        tolerance = 4 * ulp(max(abs(times[0]), abs(times[-1]))) + change.slack * rtol * elapsed
    for k in range(min(n, n_changed) + 1):
        expected, modes = change.mode_sign * base.modes[k], changed_motion.modes[k]
        if (expected != modes).any():
            return f"event {k} at {times[k]:.9g} s: mode {describe(modes)} instead of {describe(expected)}; {counts}"
        gap = abs(changed_motion.event_times[k] - times[k])
        if gap > np.broadcast_to(tolerance, times.shape)[k]:
            return f"event {k} at {times[k]:.9g} s: {gap:.2g} s off; {counts}"
    if n != n_changed:
        k = min(n, n_changed) + 1
        surplus = (changed_motion.event_times if n_changed > n else times)[k]
        return f"event {k} at {surplus:.9g} s: {'one too many' if n_changed > n else 'missing'}; {counts}"
    if change.is_exact:
        return find_changed_bits(base, changed_motion, change)
    return find_state_difference(base, changed_motion, change, states, rtol)


def describe(modes: np.ndarray) -> str:
    """Return the modes of all contacts as a text."""
    return ", ".join(str(mode) for mode in modes.tolist())


def find_changed_bits(base: Motion, changed_motion: Motion, change: Change) -> str:
    """Return the first value whose bits are not those that they must be after a change."""
    counts = ", ".join(
        f"{changed_motion.counts[name]} instead of {count} {name}"
        for name, count in base.counts.items()
        if changed_motion.counts[name] != count
    )
    n = min(len(base.time), len(changed_motion.time))
    expected = {"time": change.map_time(base.time)} | {name: change.map_column(name, base) for name in base.columns}
    columns = {"time": changed_motion.time} | changed_motion.columns
    rows = {
        name: int(np.argmax(unequal))
        for name in expected
        if (unequal := change.differ(name, expected[name][:n], columns[name][:n])).any()
    }
    if rows:
        name = min(rows, key=lambda name: rows[name])
        row = rows[name]
        difference = abs(columns[name][row] - expected[name][row]) / max(np.abs(expected[name]).max(), 5e-324)
        text = f"{name} at {expected['time'][row]:.9g} s: bits differ, by {difference:.1g} of its largest value"
        return f"{text}; {counts}" if counts else text
    return counts or ("" if len(base.time) == len(changed_motion.time) else "another number of points")


def find_state_difference(base: Motion, changed_motion: Motion, change: Change, states: list[str], rtol: float) -> str:
    """Return the first state that is not, within the tolerance, what it must be after a change."""
    points = np.linspace(base.time[0], base.time[-1], N_SAMPLES + 1)
    rows = np.abs(base.time[:, None] - points).argmin(axis=0)
    times = change.map_time(base.time[rows])
    changed_rows = np.abs(changed_motion.time[:, None] - times).argmin(axis=0)
    for name in states:
        expected = change.map_column(name, base)
        column = change.restore_column(name, changed_motion)
        other = change.moving_columns[name][0] if name in change.moving_columns else name
        # in a frame, from larger values
        computed_column = column if other == name else changed_motion.columns.get(other, column)
        size = max(np.abs(expected).max(), np.abs(computed_column).max())
        if size == 0.0:
            continue
        rate = np.abs(np.diff(expected) / np.maximum(np.diff(base.time), 1e-300)).max() if len(expected) > 1 else 0.0
        elapsed = 1.0 + (base.time[rows] - base.time[0]) / (base.time[-1] - base.time[0])
        tolerance = 8 * ulp(np.abs(times).max()) * rate + change.slack * rtol * size * elapsed
        error = np.abs(column[changed_rows] - expected[rows])
        if (error > tolerance).any():
            k = int(np.argmax(error > tolerance))
            return f"{name} at {times[k]:.9g} s: {error[k] / size:.2g} of its largest value off"
    return ""
