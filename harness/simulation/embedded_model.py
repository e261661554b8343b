"""Runs of the model class of a built FMU in this process, without FMI."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..process.subprocess_runner import run_module
from ..process.temporary_directory import temporary_directory
from ..scenes.fmu_files import build_command, check_built
from .fmu_archive import REQUIRED_VARIABLES, SCRIPT_NAME_FILE, read_description, unpack
from .mtime_cache import cached_by_mtime
from .solution import Solution

OK = 0  # status of the solver


def load_model_class(fmu: Path) -> type:
    """Return the model class of an FMU. Its package has a unique name, so several can be loaded at once.

    Raises
    ------
    HarnessError
        If the FMU is not a Python FMU of this project.
    """
    check_built(fmu)
    names = {variable.name for variable in read_description(fmu, lenient=True).modelVariables}
    if not names.issuperset(REQUIRED_VARIABLES):
        raise HarnessError(f"{fmu.name} is not an FMU of this project, whose code is needed here; `run` runs any FMU")
    return import_model_class(fmu)


@cached_by_mtime
def import_model_class(fmu: Path) -> type:
    """Import the model class of an existing FMU."""
    with unpack(fmu) as directory:
        resources = directory / "resources"
        if not (resources / SCRIPT_NAME_FILE).is_file():
            raise HarnessError(f"{fmu.name} is a native FMU; give the Python FMU of its model, built without --native")
        package = (resources / SCRIPT_NAME_FILE).read_text(encoding="utf-8").removesuffix("_fmu")
        sys.path.insert(0, str(resources))
        try:
            model: type = import_module(package).Model
        finally:
            sys.path.remove(str(resources))
        check_names(model, fmu)
        return model


def check_names(model: Any, fmu: Path) -> None:
    """Check that the code in an FMU has the names that are used here.

    Raises
    ------
    HarnessError
        If another version of this project built it.
    """
    try:
        solver = create_run(model()).solver
        method_numbers(model)
        for name in model.states:
            getattr(solver, component_name("y", name))
    except (AttributeError, ImportError, TypeError):
        command = build_command(fmu)
        raise HarnessError(
            f"{fmu.name} was built by another version of this project: build it again{command and f' with {command}'}"
        ) from None


@cache
def load_more_model(name: str) -> type:
    """Build the FMU of a model of fmus/more and return the model class in it."""
    with temporary_directory(f"{name}-") as folder:
        build = run_module("build_fmus", name, "--out", str(folder))
        if build.returncode:
            raise HarnessError(f"cannot build {name}: {(build.stderr.splitlines() or ['?'])[-1]}")
        return load_model_class(folder / f"{name}.fmu")


def method_numbers(model: Any) -> dict[str, int]:
    """Return the integration methods of a model class, by name."""
    return {name: number for name, number, _ in model.solver_class.method.items}


def create_run(model: Any) -> Any:
    """Create the run of a model: its solver and statistics, with the runtime of the model's package."""
    package = type(model).__module__.partition(".")[0]
    return import_module(f"{package}.runtime.run_state").RunState(model)


def component_name(vector: str, name: str) -> str:
    """Return the attribute of the solver for a state or mode, such as y_x."""
    return f"{vector}_{name.replace('_', '__')}"


@dataclass
class EmbeddedModel:
    """Model with values, and its run from 0 s on; all in SI units."""

    model: Any
    run: Any

    @classmethod
    def create(
        cls,
        model: type,
        values: dict[str, float],
        method: str | None,
        rtol: float,
        atol: float = 0.0,
        h_max: float = 0.0,
    ) -> "EmbeddedModel":
        """Create a model and set its values.

        Parameters
        ----------
        model : type
            Model class, from `load_model_class`.
        values : dict
            Parameters and inputs by name.
        method : str or None
            Integration method; None for the default of the model.
        rtol, atol, h_max : float
            Tolerances, and largest step in s; 0 for the defaults.

        Raises
        ------
        HarnessError
            If the model rejects a value, with its message.
        """
        instance = model()
        run = create_run(instance)
        attributes = {getattr(declaration, "element", ""): name for name, declaration in vars(model).items()}
        for name, value in values.items():
            setattr(instance, attributes.get(name, name), value)
        run.solver.rtol, run.solver.atol, run.solver.h_max = rtol, atol, h_max
        if method:
            run.solver.method = method_numbers(model)[method]
        violated_rule = instance.prepare() or run.solver.check_method(instance)
        if violated_rule:
            raise HarnessError(instance.rules[violated_rule].format_map(vars(instance)))
        return cls(instance, run)

    def start_run(self, stop: float) -> None:
        """Initialize the model and start its solver at 0 s."""
        initial_states = self.model.initial_state(0.0)  # a number, of a model of one state
        initial_states = initial_states if isinstance(initial_states, tuple) else (initial_states,)
        self.run.solver.start(self.model, 0.0, *initial_states, stop, self.run.tolerance)

    @property
    def state_reader(self) -> Callable[[Any], tuple[float, ...]]:
        """Return a function that reads the states at the current point of the solver."""
        names = [component_name("y", name) for name in self.model.states]
        return attrgetter(*names) if len(names) > 1 else lambda solver: (getattr(solver, names[0]),)

    def compute_states(self, times: list[float], timeout: float | None = None) -> list[tuple[float, ...]]:
        """Return the states at the times, starting at 0 s.

        Raises
        ------
        HarnessError
            If the run fails or takes longer than `timeout` s.
        """
        model, solver = self.model, self.run.solver
        self.start_run(times[-1])
        read = self.state_reader
        rows = [read(solver)]
        deadline = perf_counter() + timeout if timeout else None
        try:
            for t in times[1:]:
                if solver.advance(model, t) != OK:
                    raise HarnessError(f"the solver gave up at t = {solver.step.t0:.6g} s")
                rows.append(read(solver))
                if deadline and perf_counter() > deadline:
                    raise HarnessError(f"at t = {t:.3g} s after {timeout:g} s of run time")
        except (ArithmeticError, ValueError):
            raise HarnessError(f"the motion left the range of numbers after t = {solver.step.t0:.6g} s") from None
        return rows

    def solve(self, times: list[float], timeout: float | None = None) -> Solution:
        """Solve the model at the times. Changes of mode are included for a single contact with hybrid dry friction."""
        states = np.array(self.compute_states(times, timeout))
        solver = self.run.solver
        solver.report(self.run.events)
        evaluations = solver.evaluations
        has_single_dry_contact = len(self.model.contacts) == 1 and solver.step.is_hybrid
        if not has_single_dry_contact:
            return Solution(np.array(times), states, None, evaluations)
        (_, start_mode), *events = self.find_modes(times[-1])
        return Solution(np.array(times), states, events, evaluations, start_mode=start_mode)

    def find_mode_changes(self, stop: float) -> list[tuple[float, int]]:
        """Return the changes of mode up to the stop as (time in s, new mode), found by following internal steps."""
        return self.find_modes(stop)[1:]

    def find_modes(self, stop: float) -> list[tuple[float, int]]:
        """Return the mode at the start, followed by the changes of mode up to the stop."""
        model, solver, events = self.model, self.run.solver, self.run.events
        (mode,) = (component_name("modes", name) for name in model.contacts)
        self.start_run(stop)
        changes: list[tuple[float, int]] = [(0.0, getattr(solver, mode))]
        while solver.t < stop:
            solver.update_t_next(model)
            solver.advance(model, solver.t_next)
            solver.report(events)
            if events.count >= len(changes):
                changes.append((solver.t, getattr(solver, mode)))
        return changes
