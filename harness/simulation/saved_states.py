"""Motions of any FMU for co-simulation that saves its states, and their returns to a section.

A return is where an output rises through zero. The FMU repeats the step from its saved state with other sizes until the
return is at the end of the step.
"""

from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack
from math import nan

import numpy as np
from scipy.optimize import brentq

from ..errors import HarnessError, SceneError, check_names, check_varied
from ..process.interrupt import check_interrupt
from ..scenes.run_spec import RunSpec
from .fmu_archive import read_description, resolve_time_span, unpack_once
from .fmu_instance import CALL_FAILURES, FmuInstance, LogCapture, capture_stderr
from .runner import DEFAULT_COMMUNICATION_STEPS
from .session import resolve_settings
from .variable_values import REAL_TYPES
from .variational import has_capability

REPEATS = 1e-6  # difference of outputs that repeat, relative to their ranges; solvers of FMUs are less exact than ours
MAX_MULTIPLE, MAX_RETURNS = 8, 256  # returns in a period, and until a motion has repeated


class SavedStateMotion:
    """Motions of an FMU for co-simulation from its start.

    Parameters
    ----------
    spec : RunSpec
        FMU and values; a motion without a return during its run time returns no more.
    varied_names : sequence of str
        Parameters that `count_returns` sets.
    section : str
        Output that rises through zero at a return.
    resources : contextlib.ExitStack
        Closes the instance.

    Raises
    ------
    SceneError
        If a name is not valid.
    HarnessError
        If the FMU cannot save its states.
    """

    def __init__(self, spec: RunSpec, varied_names: Sequence[str], section: str, resources: ExitStack) -> None:
        description, folder = read_description(spec.fmu, spec.lenient), unpack_once(spec.fmu)
        names = "canGetAndSetFMUstate", "canGetAndSetFMUState"
        if not has_capability(folder, *names, interface_name="CoSimulation"):
            raise HarnessError(f"{spec.fmu.name} does not save its states in co-simulation: name a measure of its runs")
        variables = {variable.name: variable for variable in description.modelVariables}
        settable = [
            name for name, item in variables.items() if item.causality == "parameter" and item.type in REAL_TYPES
        ]
        check_varied("parameter", varied_names, settable, spec.values)
        self.outputs = [
            name
            for name, item in variables.items()
            if item.causality == "output" and item.type in REAL_TYPES and not item.dimensions
        ]
        if spec.inputs:
            raise SceneError(f"{spec.fmu.name} is not of this project: returns are counted without inputs; remove them")
        if not section:
            raise SceneError(
                f"{spec.fmu.name} is not of this project: name a section, one of its outputs, or a measure"
            )
        check_names("section", [section], self.outputs)
        self.spec, self.column, self.n_runs = spec, self.outputs.index(section), 0
        self.varied_variables = [variables[name] for name in varied_names]
        self.settings = resolve_settings(spec, variables)
        self.start, self.stop = resolve_time_span(spec, description)
        experiment = description.defaultExperiment
        default = (self.stop - self.start) / DEFAULT_COMMUNICATION_STEPS
        self.h = float((experiment and experiment.stepSize) or default)
        log = LogCapture(resources.enter_context(capture_stderr()))
        self.instance = FmuInstance(description, folder, log=log)
        resources.callback(self.instance.close)

    def read(self) -> np.ndarray:
        """Return the outputs."""
        return np.array([self.instance.get(name) for name in self.outputs])

    def count_returns(self, point: Sequence[float]) -> float:
        """Return the number of returns in a period; 0 if the motion returns no more, NaN if it does not repeat."""
        try:
            return self.follow(point)
        except CALL_FAILURES as error:
            raise HarnessError(self.instance.log.error_message or f"{self.spec.fmu.name}: {error}") from None

    def follow(self, point: Sequence[float]) -> float:
        """Do what `count_returns` does; failures of the FMU are raised as they are."""
        fmu, t, return_time, self.n_runs = self.instance.fmu, self.start, self.start, self.n_runs + 1
        self.instance.restart()
        self.instance.initialize([*self.settings, *zip(self.varied_variables, point, strict=True)], t, None)
        returns: deque[list[np.ndarray]] = deque(maxlen=MAX_MULTIPLE)  # outputs there, and their bounds since then
        last = low = high = self.read()
        n_returns = 0
        while t < return_time + self.stop - self.start:
            check_interrupt()
            saved_state = fmu.getFMUState()
            self.instance.step(t, self.h)
            new = self.read()
            low, high = np.minimum(low, new), np.maximum(high, new)
            passes = last[self.column] < 0.0 <= new[self.column]
            outputs = self.locate(t, saved_state, last, new) if passes else new
            fmu.freeFMUState(saved_state)
            for item in returns:
                item[1:] = np.minimum(item[1], new), np.maximum(item[2], new)
            if passes:
                for number, (old, lowest, highest) in enumerate(reversed(returns), 1):
                    if (highest - lowest)[self.column] <= REPEATS * (high - low)[self.column]:
                        return 0  # it has come to rest
                    if (np.abs(outputs - old) <= REPEATS * (highest - lowest)).all():
                        return number
                n_returns, return_time = n_returns + 1, t
                if n_returns == MAX_RETURNS:
                    return nan
                returns.append([outputs, outputs, outputs])
            last, t = new, t + self.h
        return 0

    def locate(self, t: float, saved_state: object, last: np.ndarray, new: np.ndarray) -> np.ndarray:
        """Return the outputs at the return in a step from a time in s, and go to the end of this step again."""
        outputs = [new]

        def value_after(h: float) -> float:
            if h in (0.0, self.h):
                return float((new if h else last)[self.column])
            self.instance.fmu.setFMUState(saved_state)
            self.instance.step(t, h)
            outputs[0] = self.read()
            return float(outputs[0][self.column])

        if new[self.column]:
            value_after(float(brentq(value_after, 0.0, self.h, xtol=1e-15, rtol=1e-15)))
        self.instance.fmu.setFMUState(saved_state)
        self.instance.step(t, self.h)
        return outputs[0]
