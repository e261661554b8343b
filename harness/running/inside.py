"""The model of a built FMU, run in this process by the code that the FMU carries, without FMI."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..scenes.fmus import check_built
from .answer import Answer
from .unchanged import once
from .unpacked import LAYER, unpacked

OK = 0  # status of the solver


def embedded(fmu: Path) -> type:
    """The model class inside an FMU; its package bears a name of its own, so that several live side by side."""
    check_built(fmu)
    return carried(fmu)


@once
def carried(fmu: Path) -> type:
    """The same, of a file that is there."""
    with unpacked(fmu) as folder:
        resources = folder / "resources"
        package = (resources / LAYER).read_text(encoding="utf-8").removesuffix("_fmu")
        sys.path.insert(0, str(resources))
        try:
            return import_module(package).Model
        finally:
            sys.path.remove(str(resources))


def offered(model: type) -> dict[str, int]:
    """The integration methods of a model, by name."""
    return {name: number for name, number, _ in type(model().solver).method.items}


@dataclass
class Inside:
    """A model with its values, ready to run from 0 s to the end of the times asked for; SI units."""

    model: Any

    @classmethod
    def prepared(
        cls, model: type, values: dict[str, float], method: str | None, rtol: float, atol: float = 0.0
    ) -> "Inside":
        """A fresh model, with its own method if None; HarnessError with its sentence if it refuses the values."""
        new = model()
        for name, value in values.items():
            setattr(new, name, value)
        new.solver.rtol, new.solver.atol = rtol, atol
        if method:
            new.solver.method = offered(model)[method]
        rule = new.prepare()
        if rule:
            raise HarnessError(new.rules[rule - 1].format_map(vars(new)))
        return cls(new)

    def begin(self, stop: float) -> None:
        first = self.model.initial_state(0.0)  # a number, of a model of one state
        first = first if isinstance(first, tuple) else (first,)
        self.model.solver.start(self.model, 0.0, *first, stop, self.model.tolerance)

    @property
    def read(self) -> Callable[[Any], tuple[float, ...]]:
        """What tells the states at the present point of the solver; of a body, position and speed."""
        names = [self.number(name) for name in self.model.states]
        return attrgetter(*names) if len(names) > 1 else lambda solver: (getattr(solver, names[0]),)

    def number(self, name: str) -> str:
        """What the solver calls a state or a mode: its_h_ where h means something else to it."""
        return f"its_{name}_" if hasattr(self.model.solver, f"its_{name}_") else name

    def motion(self, times: list[float], patience: float | None = None) -> list[tuple[float, ...]]:
        """The states at the times, from 0 s on; HarnessError if the run fails or outlasts `patience` s."""
        model, solver = self.model, self.model.solver
        self.begin(times[-1])
        read = self.read
        found = [read(solver)]
        late = perf_counter() + patience if patience else None
        try:
            for t in times[1:]:
                if solver.advance(model, t) != OK:
                    raise HarnessError(f"the solver gave up at t = {solver.step.t0:.6g} s")
                found.append(read(solver))
                if late and perf_counter() > late:
                    raise HarnessError(f"at t = {t:.3g} s after {patience:g} s of run time")
        except (ArithmeticError, ValueError):
            raise HarnessError(f"the motion left the range of numbers after t = {solver.step.t0:.6g} s") from None
        return found

    def answer(self, times: list[float], patience: float | None = None) -> Answer:
        """The same with counts, and with the changes of mode where the friction of one contact is dry and hybrid."""
        motion = np.array(self.motion(times, patience))
        model = self.model
        model.solver.report(model.events)
        evaluations = model.solver.evaluations
        sticks = len(model.contacts) == 1 and model.solver.step.is_hybrid
        return Answer(motion, self.events(times[-1]) if sticks else None, evaluations)

    def events(self, stop: float) -> list[tuple[float, int]]:
        """Changes of mode up to the stop, seen by following the solver's own steps."""
        return self.modes(stop)[1:]

    def modes(self, stop: float) -> list[tuple[float, int]]:
        """The same after the mode at the start."""
        model, solver, (mode,) = self.model, self.model.solver, map(self.number, self.model.contacts)
        self.begin(stop)
        found: list[tuple[float, int]] = [(0.0, getattr(solver, mode))]
        while solver.t < stop:
            solver.update_t_next(model)
            solver.advance(model, solver.t_next)
            solver.report(model.events)
            if model.events.count >= len(found):
                found.append((solver.t, getattr(solver, mode)))
        return found
