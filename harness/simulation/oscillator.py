"""Motions of a native FMU from given states, in coordinates that repeat in a periodic motion.

The coordinates c = B^T y leave out translations that change no force, as of a sled together with its driver, and the
phase angle of a force.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import chain, islice
from math import inf
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np

from ..errors import HarnessError, SceneError, check_names
from ..process.interrupt import check_interrupt
from ..scenes.run_spec import RunSpec
from .fmu_archive import read_description, unpack_once
from .fmu_instance import CALL_FAILURES, FmuInstance
from .fmu_variables import METHOD
from .model_data import read_model_data
from .native_equivalent import check_has_events
from .runner import open_instance, open_session
from .session import Session, resolve_settings
from .variable_values import enumeration_labels, variable_unit
from .variational import VariationalRun, state_variables

RTOL = "solver.rtol"
DEFAULTS = {METHOD: "dop853", RTOL: 1e-12}  # of the solver, unless a user sets others
MAX_STEPS = 200_000  # internal steps of a motion
MAX_ITERATIONS = 30  # of Newton's method
SAMPLED = 3  # points of a motion at which derivatives are compared
STOP = 1e9  # s: no motion ends there


class Point(NamedTuple):
    """A point of a motion: time in s, states and rates (n,), modes of the contacts, and the number of their changes."""

    t: float
    y: np.ndarray
    f: np.ndarray
    modes: tuple[int, ...]
    n_changes: int

    @property
    def sticks(self) -> bool:
        """Return whether a contact sticks."""
        return 0 in self.modes


class Oscillator:
    """A native FMU whose motions start at given states.

    Parameters
    ----------
    spec : RunSpec
        Native FMU with directional derivatives, and values.
    varied : sequence of str
        Parameters that `set_point` changes.

    Attributes
    ----------
    states : tuple of str
        Names of the states.
    start : numpy.ndarray
        States (n,) at the start of the source.
    basis : numpy.ndarray
        The coordinates that repeat (n, r), B above.
    phase : int or None
        Index of the state that is the phase angle of a force.
    coordinate : int
        Index of the state that measures a motion, and whose maximum is the section of motions without events.
    n_runs : int
        Number of runs up to now.

    Raises
    ------
    SceneError
        If a varied parameter is unknown or set.
    HarnessError
        If its friction law has no events, or its states cannot be set.
    """

    def __init__(self, spec: RunSpec, varied: Sequence[str] = ()) -> None:
        description, self.folder = read_description(spec.fmu), unpack_once(spec.fmu)
        variables = {variable.name: variable for variable in description.modelVariables}
        settable = [name for name, item in variables.items() if item.causality == "parameter" and item.type == "Real"]
        check_names("parameter", varied, settable)
        for name in varied:
            if name in spec.values:
                raise SceneError(f"{name} is both varied and set; remove one of them")
        self.variables, self.varied, self.n_runs = variables, tuple(varied), 0
        self.parameters = settable
        self.states = tuple(state.name for state in state_variables(description))
        self.rates = tuple(unknown.variable.name for unknown in description.derivatives)
        self.units = {name: variable_unit(variable) for name, variable in variables.items()}
        methods = enumeration_labels(variables[METHOD]).values() if METHOD in variables else ()
        values = {
            name: value for name, value in DEFAULTS.items() if name in variables and (name == RTOL or value in methods)
        }
        self.spec = replace(spec, values=values | dict(spec.values), start=0.0, stop=STOP, follow=False)
        modes = tuple(read_model_data(spec.fmu).contacts.values())
        reals = [*dict.fromkeys((*self.states, *self.rates, "events.t_last", "solver.t_next"))]
        self.positions = [[reals.index(name) for name in group] for group in (self.states, self.rates)]
        self.n_reals, self.n_modes = len(reals), len(modes)
        initial = find_start_parameters(description, self.states)
        angles = [name for name in settable if variables[name].variability == "fixed" and self.units[name] == "rad"]
        self.initial = tuple(dict.fromkeys([*initial, *angles]))
        self.exchange: FmuInstance | None = None
        self.equilibria: list[np.ndarray] = []
        self.settings = {variable.name: value for variable, value in resolve_settings(self.spec, variables)}
        check_has_events(spec.fmu, variables, self.settings)
        with ExitStack() as resources:  # an open instance keeps standard error redirected
            opened = open_session(self.spec, (*self.varied, *self.initial), [*reals, *modes, "events.count"])
            session = resources.enter_context(opened)
            assert isinstance(session, Session)
            self.session, self.instance = session, session.instance
            self.find_coordinates_of_start(len(initial))
            self.resources = resources.pop_all()

    def find_coordinates_of_start(self, n_states: int) -> None:
        """Find how parameters, of which the first `n_states` set states, move the start, and the coordinates."""
        self.set_point([self.default(name) for name in self.varied])
        self.offsets = np.array([self.default(name) for name in self.initial])
        self.turned = np.zeros((len(self.states), len(self.initial)))
        self.start = self.begin_with(self.offsets).y
        steps = np.eye(len(self.initial))
        columns = [self.begin_with(self.offsets + step).y - self.start for step in steps]
        self.matrix = np.array(columns).reshape(-1, len(self.states)).T
        self.inverse = np.linalg.pinv(self.matrix)
        self.find_phase_angle(range(n_states, len(self.initial)))
        self.inverse = np.linalg.pinv(self.matrix)
        self.find_coordinates()

    def find_phase_angle(self, parameters: Sequence[int]) -> None:
        """Find the parameter, by its index, that adds to a phase angle which itself always starts at zero.

        A motion and one that starts with the angle that it has reached then have the same rates.
        """
        for y in islice(self.sliding_states(), 1):
            for k in np.flatnonzero(~self.matrix.any(axis=1)):
                first = self.begin(y)
                h = 0.3 / abs(first.f[k]) if first.f[k] else 1.0
                later = self.step(0.0, h)
                shift = self.inverse @ (later.y - self.start)
                for j in parameters:
                    angle = (later.y[k] - first.y[k]) * np.eye(len(self.initial))[j]
                    rates = self.begin_with(self.offsets + shift + angle).f
                    if np.allclose(rates, later.f, rtol=1e-6, atol=0.0):
                        self.turned[k, j] = self.matrix[k, j] = 1.0
                        self.start = self.begin_with(self.offsets).y
                        break

    def default(self, name: str) -> float:
        """Return the value of a parameter of the source."""
        return float(self.settings.get(name, self.variables[name].start or 0.0))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.resources.close()

    # ---- motions

    def set_point(self, point: Sequence[float]) -> None:
        """Set the values of the varied parameters."""
        self.point = tuple(map(float, point))

    def begin_with(self, initial: np.ndarray) -> Point:
        """Start a motion with values of the parameters that set the states."""
        self.n_runs += 1
        self.shift = self.turned @ initial
        try:
            self.session.start((*self.point, *initial.tolist()))
        except CALL_FAILURES as error:
            raise self.failure(error) from None
        return self.read(0.0)

    def initial_values(self, y: np.ndarray) -> np.ndarray:
        """Return the values of the parameters that set the states (n,)."""
        return np.asarray(self.offsets + self.inverse @ (y - self.start))

    def begin(self, y: np.ndarray) -> Point:
        """Start a motion from states (n,)."""
        return self.begin_with(self.initial_values(y))

    def read(self, t: float) -> Point:
        """Return the present point; `t_next` is the end of the next internal step."""
        values = self.session.read()
        reals, (*modes, count) = np.array(values[: self.n_reals]), values[self.n_reals :]
        self.t_event, self.t_next = values[self.n_reals - 2 : self.n_reals]
        return Point(
            t, reals[self.positions[0]] + self.shift, reals[self.positions[1]], tuple(map(int, modes)), int(count)
        )

    def step(self, t: float, h: float) -> Point:
        """Go on from a time by h, in s."""
        try:
            self.instance.step(t, h)
        except CALL_FAILURES as error:
            raise self.failure(error) from None
        return self.read(t + h)

    def failure(self, error: Exception) -> HarnessError:
        """Return the error of a run that failed, with the message of the FMU."""
        return HarnessError(self.instance.log.error_message or f"{self.spec.fmu.name}: {error}")

    def follow(self, y: np.ndarray, stop: float = STOP) -> Iterator[Point]:
        """Yield the ends of internal steps from states y until a time in s; a change of mode ends a step."""
        point = self.begin(y)
        yield point
        for number in range(MAX_STEPS):
            if number % 1000 == 0:
                check_interrupt()
            if point.t >= stop:
                return
            end = min(max(self.t_next, float(np.nextafter(point.t, inf))), stop)
            point = self.step(point.t, end - point.t)
            yield point
        raise HarnessError(f"the motion needs more than {MAX_STEPS} steps until t = {point.t:.6g} s")

    def differentiate(self, y: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the states (n,) after a time in s, and their derivatives (n, n) by the states y, or NaN."""
        if self.exchange is None:
            self.exchange = self.resources.enter_context(open_instance(replace(self.spec, exchange=True)))
        initial = dict(zip(self.initial, self.initial_values(y).tolist(), strict=True))
        spec = replace(
            self.spec,
            values=self.settings | dict(zip(self.varied, self.point, strict=True)) | initial,
            outputs=self.states,
            times=np.array([period]),
            stop=period,
            tolerance=self.settings.get(RTOL),
        )
        solution = VariationalRun(self.exchange, self.folder, spec, self.initial).solve()
        slopes = np.where(solution.left[0] == solution.right[0], solution.left[0], np.nan)
        return solution.values[0], slopes.T @ self.inverse

    # ---- coordinates

    def jacobian(self, y: np.ndarray) -> np.ndarray:
        """Return the derivatives (n, n) of the rates by the states."""
        self.begin(y)
        return self.read_jacobian()

    def read_jacobian(self) -> np.ndarray:
        """Return the derivatives (n, n) of the rates by the states at the present point."""
        unknowns, knowns = (
            [self.variables[name].valueReference for name in names] for names in (self.rates, self.states)
        )
        return np.array([self.instance.fmu.getDirectionalDerivative(unknowns, [one], [1.0]) for one in knowns]).T

    def sliding_states(self) -> Iterator[np.ndarray]:
        """Yield states near the start in which no contact sticks: there the speeds are changed by other rates."""
        rates = self.begin(self.start).f
        is_speed = np.isin(self.states, self.rates)
        sizes = sorted({*np.abs(rates).tolist()} - {0.0}) or [1.0]
        moved = [self.start + sign * size * is_speed for size in sizes for sign in (1, -1)]
        yield from (y for y in (self.start, *moved) if not self.begin(y).sticks)

    def find_coordinates(self) -> None:
        """Find the coordinates that repeat."""
        n, states = len(self.states), [*self.sliding_states()]
        if not states:
            raise HarnessError(f"{self.spec.fmu.name} has no motion near its start: choose another start")
        rates = self.begin(states[0]).f
        points = (point for y in states for point in islice(self.follow(y), 0, SAMPLED * 10, 10) if not point.sticks)
        jacobians = np.array([self.read_jacobian() for _ in points])
        is_constant = ~jacobians.any(axis=(0, 2))
        is_angle = np.array([self.units[name] == "rad" for name in self.states])
        phases = np.flatnonzero(is_constant & is_angle & (rates != 0.0) & jacobians.any(axis=(0, 1)))
        self.phase = int(phases[0]) if len(phases) else None
        kept = [i for i in range(n) if i != self.phase]
        _, sizes, rows = np.linalg.svd(np.concatenate(jacobians)[:, kept])
        rank = int(np.count_nonzero(sizes > 1e-10 * sizes[0]))
        self.basis = np.zeros((n, rank))
        self.basis[kept] = np.eye(rank) if rank == len(kept) else rows[:rank].T
        measured = np.flatnonzero(self.basis.any(axis=1) & ~is_constant)
        if not len(measured):
            raise HarnessError(f"{self.spec.fmu.name} has no forces that depend on its states, and no oscillations")
        self.coordinate = int(measured[0])
        row = self.basis[self.coordinate]
        self.gauge = self.basis @ row / (row @ row)
        set_by = np.column_stack([self.basis, np.eye(n)[:, phases[:1]]])
        reduced = set_by.T @ self.matrix
        self.inverse = np.linalg.pinv(reduced) @ set_by.T  # translations stay as they are at the start
        for name, missing in zip(self.states, set_by @ (reduced @ np.linalg.pinv(reduced)) - set_by, strict=True):
            if np.abs(missing).max() > 1e-9:
                raise HarnessError(
                    f"{self.spec.fmu.name}: no parameter sets {name} at the start: declare one, as in start={name}0 of "
                    f"the state, with {name}0 a Fixed of the model"
                )

    @property
    def forced_period(self) -> float | None:
        """Return the period of the force in s; None without a force."""
        return None if self.phase is None else 2.0 * np.pi / abs(float(self.begin(self.start).f[self.phase]))

    def reduce(self, y: np.ndarray) -> np.ndarray:
        """Return the coordinates (r,) of states or rates."""
        return np.asarray(self.basis.T @ y)

    def measure(self, y: np.ndarray) -> float:
        """Return the value, without translations, of the state that measures a motion."""
        return float(self.gauge @ y)

    # ---- equilibria

    def find_equilibrium(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the states (n,) of steady sliding and their eigenvalues (r,) in 1/s, by Newton's method, or None."""
        if self.phase is not None:
            return None
        for y in chain(self.equilibria[-1:], self.sliding_states()):
            for _ in range(MAX_ITERATIONS):
                point = self.begin(y)
                matrix = self.basis.T @ self.jacobian(y) @ self.basis
                if point.sticks or not matrix.any():
                    break
                change = self.basis @ np.linalg.lstsq(matrix, -self.reduce(point.f), rcond=None)[0]
                if np.abs(change).max() <= 1e-15 * np.abs(y).max():
                    break
                y = y + change
            scale = max(1e-3, float(np.abs(point.f).max()))
            if not point.sticks and np.abs(self.reduce(point.f)).max() <= 1e-10 * scale:
                eigenvalues = np.linalg.eigvals(matrix)
                self.begin(y)
                later = self.step(0.0, 1.0 / float(np.abs(eigenvalues).max()))
                if not later.n_changes:  # it slides on, with a speed that is not zero by rounding
                    self.equilibria = [y]  # a good guess at the next point
                    return y, eigenvalues
        return None


def find_start_parameters(description: Any, states: Sequence[str]) -> tuple[str, ...]:
    """Return the variables that set the states at the start: states themselves, or fixed parameters of their starts."""
    names = []
    for unknown in description.initialUnknowns:
        if unknown.variable.name in states:
            names += [item.name for item in unknown.dependencies or () if item.variability == "fixed"]
    exact = [item.name for item in description.modelVariables if item.name in states and item.initial == "exact"]
    return tuple(dict.fromkeys([*names, *exact]))
