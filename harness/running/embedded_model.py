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
from ..scenes.fmu_files import check_built
from .cached_by_mtime import cached_by_mtime
from .solution import Solution
from .unpacking import SCRIPT_NAME_FILE, unpack

OK = 0  # status of the solver


def load_model_class(fmu: Path) -> type:
    """The model class inside an FMU; its package bears a name of its own, so that several live side by side."""
    check_built(fmu)
    return import_model_class(fmu)


@cached_by_mtime
def import_model_class(fmu: Path) -> type:
    """The same, of a file that is there."""
    with unpack(fmu) as folder:
        resources = folder / "resources"
        package = (resources / SCRIPT_NAME_FILE).read_text(encoding="utf-8").removesuffix("_fmu")
        sys.path.insert(0, str(resources))
        try:
            return import_module(package).Model
        finally:
            sys.path.remove(str(resources))


def method_numbers(model: type) -> dict[str, int]:
    """The integration methods of a model, by name."""
    return {name: number for name, number, _ in type(model().solver).method.items}


@dataclass
class EmbeddedModel:
    """A model with its values, ready to run from 0 s to the end of the times asked for; SI units."""

    model: Any

    @classmethod
    def create(
        cls, model: type, values: dict[str, float], method: str | None, rtol: float, atol: float = 0.0
    ) -> "EmbeddedModel":
        """A fresh model, with its own method if None; HarnessError with its sentence if it refuses the values."""
        new = model()
        for name, value in values.items():
            setattr(new, name, value)
        new.solver.rtol, new.solver.atol = rtol, atol
        if method:
            new.solver.method = method_numbers(model)[method]
        rule = new.prepare()
        if rule:
            raise HarnessError(new.rules[rule - 1].format_map(vars(new)))
        return cls(new)

    def start_run(self, stop: float) -> None:
        first = self.model.initial_state(0.0)  # a number, of a model of one state
        first = first if isinstance(first, tuple) else (first,)
        self.model.solver.start(self.model, 0.0, *first, stop, self.model.tolerance)

    @property
    def state_reader(self) -> Callable[[Any], tuple[float, ...]]:
        """What tells the states at the present point of the solver; of a body, position and speed."""
        names = [self.solver_attribute(name) for name in self.model.states]
        return attrgetter(*names) if len(names) > 1 else lambda solver: (getattr(solver, names[0]),)

    def solver_attribute(self, name: str) -> str:
        """What the solver calls a state or a mode: its_h_ where h means something else to it."""
        return f"its_{name}_" if hasattr(self.model.solver, f"its_{name}_") else name

    def compute_states(self, times: list[float], timeout: float | None = None) -> list[tuple[float, ...]]:
        """The states at the times, from 0 s on; HarnessError if the run fails or outlasts `timeout` s."""
        model, solver = self.model, self.model.solver
        self.start_run(times[-1])
        read = self.state_reader
        found = [read(solver)]
        late = perf_counter() + timeout if timeout else None
        try:
            for t in times[1:]:
                if solver.advance(model, t) != OK:
                    raise HarnessError(f"the solver gave up at t = {solver.step.t0:.6g} s")
                found.append(read(solver))
                if late and perf_counter() > late:
                    raise HarnessError(f"at t = {t:.3g} s after {timeout:g} s of run time")
        except (ArithmeticError, ValueError):
            raise HarnessError(f"the motion left the range of numbers after t = {solver.step.t0:.6g} s") from None
        return found

    def solve(self, times: list[float], timeout: float | None = None) -> Solution:
        """The same with counts, and with the changes of mode where the friction of one contact is dry and hybrid."""
        motion = np.array(self.compute_states(times, timeout))
        model = self.model
        model.solver.report(model.events)
        evaluations = model.solver.evaluations
        sticks = len(model.contacts) == 1 and model.solver.step.is_hybrid
        return Solution(motion, self.find_mode_changes(times[-1]) if sticks else None, evaluations)

    def find_mode_changes(self, stop: float) -> list[tuple[float, int]]:
        """Changes of mode up to the stop, seen by following the solver's own steps."""
        return self.find_modes(stop)[1:]

    def find_modes(self, stop: float) -> list[tuple[float, int]]:
        """The same after the mode at the start."""
        model, solver, (mode,) = self.model, self.model.solver, map(self.solver_attribute, self.model.contacts)
        self.start_run(stop)
        found: list[tuple[float, int]] = [(0.0, getattr(solver, mode))]
        while solver.t < stop:
            solver.update_t_next(model)
            solver.advance(model, solver.t_next)
            solver.report(model.events)
            if model.events.count >= len(found):
                found.append((solver.t, getattr(solver, mode)))
        return found
