"""One instance of an FMU run again and again by reset: what a sweep does in each of its workers."""

import io
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from ctypes import c_double, c_int, c_void_p
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from time import perf_counter
from typing import Any

from ...errors import HarnessError
from ...running.fmu import (
    WARNING,
    FMICallException,
    begin,
    buffer,
    callbacks,
    gather,
    instance,
    parameters,
    planned,
    traced,
)
from ...running.settings import settings
from ...running.specification import Specification
from ...scenes.roles import roles
from .measures import AT_END, ON_PATH, PIECES


@dataclass(frozen=True)
class Runs:
    """What the runs of a sweep share: the `varied` names, `values` and `stop` (None: the FMU's) for all, `measures`."""

    model: str
    varied: tuple[str, ...]
    values: dict[str, float | str]
    stop: float | None
    measures: tuple[str, ...]


Measured = tuple[list[float], str]  # the measured columns, or the sentence that says why there are none


class Rerun:
    """The instance, and the room for what is set and read, made once: a run by closed form takes a tenth of a ms."""

    def __init__(self, runs: Runs, description: Any, fmu: Any, wanted: Specification) -> None:
        self.runs, self.fmu, self.description = runs, fmu, description
        variables = {variable.name: variable for variable in description.modelVariables}
        motion = roles(variables)
        self.plan = planned(replace(wanted, outputs=(motion["position"], motion["velocity"])), description)
        if runs.stop is not None:
            self.plan = replace(self.plan, stop=runs.stop)
        self.fixed = settings(wanted, variables)
        self.varied = [variables[name] for name in runs.varied]
        self.along = [name for name in runs.measures if name in ON_PATH]
        if self.along:
            grid = (self.plan.stop - self.plan.start) / PIECES
            self.plan = replace(
                planned(replace(self.plan.wanted, grid=grid, follow=True), description), stop=self.plan.stop
            )
        self.ends = [AT_END[name][1] for name in runs.measures if name in AT_END]
        self.n_whole, self.whole_at, self.whole = buffer(variables, self.ends, c_int)
        self.n_real, self.real_at, self.real = buffer(variables, list(self.plan.wanted.outputs), c_double)
        self.component = c_void_p(fmu.component)
        self.messages = callbacks()[1]

    def run(self, point: list[float]) -> Measured:
        """The measures at a point of the varied values, or the FMU's sentence why it has none."""
        self.messages.clear()
        try:
            self.begin(point)
            begun = perf_counter()
            along = self.follow(begun) if self.along else self.leap()
            return self.read(along, perf_counter() - begun), ""
        except FMICallException as error:
            lines = [text for status, text in self.messages if status > WARNING]
            return [], lines[-1] if lines else str(error)
        except HarnessError as error:
            return [], str(error)

    def constants(self) -> dict[str, float | str]:
        """The value of every parameter in a run; HarnessError with the FMU's sentence if it refuses the values."""
        _, error = self.run([])
        if error:
            raise HarnessError(error)
        return parameters(self.plan, self.fmu)

    def begin(self, point: list[float]) -> None:
        """Reset, set and initialise."""
        self.fmu.reset()
        values = (*self.fixed, *zip(self.varied, point, strict=True))
        begin(self.fmu, values, self.plan.start, self.plan.stop)

    def leap(self) -> dict[str, float]:
        """One communication step to the stop: nothing along the path."""
        start, stop = self.plan.start, self.plan.stop
        status = self.fmu.dll.fmi2DoStep(self.component, start, stop - start, 1)
        if status > WARNING:
            raise FMICallException("fmi2DoStep", status)
        return {}

    def follow(self, begun: float) -> dict[str, float]:
        """Step along the path, and measure there."""
        trace = traced(self.plan, self.fmu, lambda share: None, 0)
        run = gather(self.plan, self.fmu, trace, perf_counter() - begun)
        return {name: ON_PATH[name].measure(run) for name in self.along}

    def read(self, along: dict[str, float], seconds: float) -> list[float]:
        """The columns in the order of the measures."""
        dll = self.fmu.dll
        dll.fmi2GetReal(self.component, self.real_at, self.n_real, self.real)
        dll.fmi2GetInteger(self.component, self.whole_at, self.n_whole, self.whole)
        whole = dict(zip(self.ends, self.whole, strict=True))
        row: list[float] = []
        for name in self.runs.measures:
            if name == "final":
                row += self.real
            elif name == "run_time":
                row.append(seconds)
            elif name in AT_END:
                row.append(float(whole[AT_END[name][1]]))
            else:
                row.append(along.get(name, nan))
        return row


@contextmanager
def ready(runs: Runs, file: Path) -> Iterator[Rerun]:
    """The FMU in a file, loaded and ready to run; what it writes to standard error is kept back."""
    wanted = Specification(file, values=runs.values, grid=1.0, follow=False)
    with redirect_stderr(io.StringIO()), instance(wanted, callbacks()[0]) as (description, fmu):
        yield Rerun(runs, description, fmu, wanted)
