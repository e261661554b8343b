"""Input signals of a run: a table over time, linear between its rows."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

import numpy as np

from ..errors import HarnessError, SceneError, check_names
from .fmu_session import FmuSession
from .variable_values import REAL_TYPES

Inputs = Mapping[str, Sequence[float]]  # "time" in s, and the values of each input at these times

TIME = "time"


def check_inputs(inputs: Inputs, variables: Mapping[str, Any]) -> None:
    """Check a table of input signals against the variables of an FMU.

    Parameters
    ----------
    inputs : mapping
        The column ``time`` in s, which does not fall, and a column for each input. A time that occurs twice is a jump.
    variables : mapping
        The variables of the model description by name.

    Raises
    ------
    SceneError
        If a column is missing, unknown, not finite or of another length.
    """
    if not inputs:
        return
    if TIME not in inputs:
        raise SceneError("inputs has no column 'time': add the times in s, as in {'time': [0, 1], 'F_ext': [0, 5]}")
    names = [
        name for name, variable in variables.items() if variable.causality == "input" and variable.type in REAL_TYPES
    ]
    check_names("input", [name for name in inputs if name != TIME], [name for name in names if name != TIME])
    rows = len(inputs[TIME])
    for name, column in inputs.items():
        if len(column) != rows or not rows:
            raise SceneError(f"inputs: {name} has {len(column)} values for {rows} times; give one for each time")
        if not np.isfinite(np.asarray(column, dtype=float)).all():
            raise SceneError(f"inputs: {name} holds a value that is not a finite number")
    if (np.diff(inputs[TIME]) < 0).any():
        raise SceneError("inputs: the time falls; sort the rows by time")


def input_signals(inputs: Inputs, session: FmuSession) -> "InputSignals | None":
    """Return what sets the inputs of an instance, None without input signals."""
    return InputSignals(inputs, session) if any(name != TIME for name in inputs) else None


class InputSignals:
    """Sets the inputs of an FMU instance from a table.

    In co-simulation an input is constant within a communication step; its value in the middle of the step makes the
    error of second order in the step.

    Parameters
    ----------
    inputs : mapping
        The table, as `check_inputs` describes it.
    session : FmuSession
        The instance.

    Raises
    ------
    HarnessError
        If the inputs are of several types.
    """

    def __init__(self, inputs: Inputs, session: FmuSession) -> None:
        variables = [session.variables[name] for name in inputs if name != TIME]
        kinds = {variable.type for variable in variables}
        if len(kinds) > 1:
            raise HarnessError(f"inputs of several types ({', '.join(sorted(kinds))}) cannot be driven at once")
        self.set_values = getattr(session.fmu, f"set{kinds.pop()}")
        self.references = [variable.valueReference for variable in variables]
        self.time = np.asarray(inputs[TIME], dtype=float)
        self.columns = [np.asarray(column, dtype=float) for name, column in inputs.items() if name != TIME]
        self.jumps = self.time[1:][np.diff(self.time) == 0]

    def apply(self, time: float, continuous: bool = True, discrete: bool = True, after_event: bool = False) -> None:
        """Set the inputs at a time in s; at a jump the value before it, or after it if `after_event`.

        The signature is that of fmpy's Input, whose place this class takes in fmpy's solvers.
        """
        i = int(np.searchsorted(self.time, time, side="right" if after_event else "left"))
        self.set_values(self.references, [self.value(column, i, time) for column in self.columns])

    def value(self, column: np.ndarray, i: int, time: float) -> float:
        """Interpolate a column at a time in s, which lies between the rows i - 1 and i."""
        if i == 0 or i == len(self.time):
            return float(column[min(i, len(column) - 1)])
        before, after = self.time[i - 1 : i + 1].tolist()
        share = (time - before) / (after - before)
        return float((1.0 - share) * column[i - 1] + share * column[i])

    def next_jump(self, time: float) -> float:
        """Return the time in s of the first jump after a time, inf if there is none."""
        later = self.jumps[self.jumps > time]
        return float(later[0]) if len(later) else inf
