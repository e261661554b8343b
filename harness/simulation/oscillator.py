"""Motions of a native FMU from given states, in coordinates that repeat in a periodic motion.

The coordinates that repeat leave out translations that change no force, as of a sled together with its driver, and the
phase angle of a force.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import cached_property
from itertools import chain, islice
from math import inf, nan, pi
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from ..errors import HarnessError, SceneError, check_names, check_varied
from ..process.interrupt import check_interrupt
from ..scenes.run_spec import RunSpec
from .fmu_archive import read_description, unpack_once
from .fmu_instance import CALL_FAILURES, FmuInstance
from .fmu_variables import METHOD
from .model_data import read_model_data
from .native_equivalent import check_has_events
from .runner import open_instance
from .session import Session, resolve_settings
from .stepping import TIME, check_inputs, input_signals
from .variable_values import enumeration_labels, variable_unit
from .variational import VariationalRun, state_variables

RTOL = "solver.rtol"
METHODS = {"exact": "dop853", "ode23": "dop853", "ode45": "dop853", "rodas": "radau9"}  # as accurate as RTOL below
DEFAULT_RTOL = 1e-12
MAX_STEPS = 200_000  # internal steps of a motion
MAX_ITERATIONS = 30  # of Newton's method
SAMPLE_POINTS = 3  # points of a motion at which derivatives are compared
PERIODS = 256  # of inputs: more than a motion is followed
STOP = 1e100  # s: no motion ends there


class Point(NamedTuple):
    """A point of a motion: time in s, states and rates (n,), modes of the contacts, and the number of their changes.

    `section` is the value of the variable whose zeros are the section; NaN without one.
    """

    t: float
    y: np.ndarray
    f: np.ndarray
    modes: tuple[int, ...]
    n_changes: int
    section: float = nan

    @property
    def sticks(self) -> bool:
        """Return whether a contact sticks."""
        return 0 in self.modes


class SteadySliding(NamedTuple):
    """Steady sliding: its states (n,), and eigenvalues (r,) in 1/s of small motions around it."""

    y: np.ndarray
    eigenvalues: np.ndarray

    @property
    def growth(self) -> float:
        """Return the growth rate of small motions in 1/s."""
        return float(self.eigenvalues.real.max())

    @property
    def frequency(self) -> float:
        """Return the angular frequency of small motions in rad/s; zero if they do not oscillate."""
        return float(np.abs(self.eigenvalues.imag).max())

    @property
    def turn_time(self) -> float:
        """Return about the time of a turn in s."""
        return 2.0 * pi / (self.frequency or float(np.abs(self.eigenvalues).max()))


@contextmanager
def open_oscillator(
    spec: RunSpec, varied_names: Sequence[str] = (), period: float | None = None, section: str = ""
) -> "Iterator[Oscillator]":
    """Open an oscillator; its parameters are those of `Oscillator`."""
    with ExitStack() as resources:
        yield Oscillator(spec, varied_names, period, section, resources)


class Oscillator:
    """A native FMU whose motions start at given states.

    Parameters
    ----------
    spec : RunSpec
        Native FMU with directional derivatives, and values.
    varied_names : sequence of str
        Parameters that `set_point` changes.
    period : float or None
        Period in s of forces that depend on a clock.
    section : str
        What free motions return to: the mode of a contact, where it ends to stick, or a number, where it rises through
        zero. Empty for the end of any stick.
    resources : contextlib.ExitStack
        Closes the instances.

    Attributes
    ----------
    states, rates : tuple of str
        Names of the states and of their rates.
    start : numpy.ndarray
        States (n,) at the start of the source.
    rate : float
        Frequency in 1/s that makes changes of speeds comparable with those of positions.
    basis, reduction : numpy.ndarray
        Changes of the states (n, r) by the coordinates that repeat, and these by the states (r, n).
    phase : int or None
        Index of the state that is the phase angle of a force, or its clock.
    sets_phase : bool
        Whether a parameter sets this state at the start.
    coordinate : int
        Index of the state that measures a motion.
    gauge : numpy.ndarray
        Weights of the states (n,) in this one without translations, as of a sled against its driver.
    displacement : numpy.ndarray
        Change of the states (n,) that changes it by 1.
    speeds : numpy.ndarray
        Ones (n,) at the states that are rates of others, zeros elsewhere.
    n_modes : int
        Number of contacts.
    n_runs : int
        Number of runs up to now.

    Raises
    ------
    SceneError
        If a varied parameter is unknown or set.
    HarnessError
        If its friction law has no events, or its states cannot be set.
    """

    def __init__(
        self, spec: RunSpec, varied_names: Sequence[str], period: float | None, section: str, resources: ExitStack
    ) -> None:
        self.resources, self.varied_names, self.period, self.n_runs = resources, tuple(varied_names), period, 0
        description, self.folder = read_description(spec.fmu), unpack_once(spec.fmu)
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.parameters = [
            name for name, item in self.variables.items() if item.causality == "parameter" and item.type == "Real"
        ]
        check_varied("parameter", varied_names, self.parameters, spec.values)
        self.states = tuple(state.name for state in state_variables(description))
        self.rates = tuple(unknown.variable.name for unknown in description.derivatives)
        self.speeds = np.isin(self.states, self.rates).astype(float)
        self.units = {name: variable_unit(variable) for name, variable in self.variables.items()}
        check_inputs(spec.inputs, self.variables, spec.values)
        values, inputs = choose_solver(self.variables) | dict(spec.values), repeat_inputs(spec.inputs, period)
        self.spec = replace(spec, values=values, inputs=inputs, start=0.0, stop=STOP, follow=False)
        self.rows = np.append(np.asarray(inputs.get(TIME, ()), dtype=float), inf)
        self.settings = {variable.name: value for variable, value in resolve_settings(self.spec, self.variables)}
        check_has_events(spec.fmu, self.variables, self.settings)
        angles = [
            name
            for name in self.parameters
            if self.variables[name].variability == "fixed" and self.units[name] == "rad"
        ]
        self.initial = tuple(dict.fromkeys([*find_start_parameters(description, self.states), *angles]))
        modes = tuple(read_model_data(spec.fmu).contacts.values())
        readable = [name for name, item in self.variables.items() if item.causality == "output" and item.type == "Real"]
        check_names("section", [section] * bool(section), [*dict.fromkeys((*modes, *self.states, *readable))])
        self.section_variable = "" if section in modes else section
        self.section_modes = slice(modes.index(section), modes.index(section) + 1) if section in modes else slice(None)
        reals = [*dict.fromkeys((*self.states, *self.rates, *[section] * bool(self.section_variable), "solver.t_next"))]
        groups = self.states, self.rates, [section] * bool(self.section_variable)
        self.positions = [[reals.index(name) for name in group] for group in groups]
        self.n_modes, read_names = len(modes), [*modes, *["events.count"] * bool(modes), *reals]
        self.instance = resources.enter_context(open_instance(self.spec, self.folder))
        self.session = Session(self.instance, self.spec, (*self.varied_names, *self.initial), read_names)
        self.signals = input_signals(self.spec, self.instance)
        self.last_equilibrium: np.ndarray | None = None
        self.set_point([self.default(name) for name in varied_names])
        self.offsets = np.array([self.default(name) for name in self.initial])
        self.phase_matrix = np.zeros((len(self.states), len(self.initial)))
        self.start = self.begin_with(self.offsets).y
        columns = [self.begin_with(self.offsets + step).y - self.start for step in np.eye(len(self.initial))]
        self.matrix = np.array(columns).reshape(-1, len(self.states)).T
        self.inverse = np.linalg.pinv(self.matrix)
        self.find_coordinates()
        if section and self.is_forced:
            raise SceneError("motions with a force return after its period: remove the section")

    def default(self, name: str) -> float:
        """Return the value of a parameter of the source."""
        return float(self.settings.get(name, self.variables[name].start or 0.0))

    def set_point(self, point: Sequence[float]) -> None:
        """Set the values of the varied parameters."""
        self.point = tuple(map(float, point))

    # ---- motions

    def begin_with(self, initial: np.ndarray) -> Point:
        """Start a motion with values of the parameters that set the states."""
        self.shift = self.phase_matrix @ initial
        try:
            self.session.start((*self.point, *initial.tolist()))
            if self.signals:
                self.signals.apply(0.0, after_event=True)
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
        modes, reals = values[: self.n_modes], np.array(values[self.n_modes + bool(self.n_modes) :])
        self.t_next = float(reals[-1])
        n_changes = int(values[self.n_modes]) if modes else 0
        y = reals[self.positions[0]] + self.shift
        section = float(reals[self.positions[2]].sum()) if self.section_variable else nan
        return Point(t, y, reals[self.positions[1]], tuple(map(int, modes)), n_changes, section)

    def step(self, t: float, end: float) -> Point:
        """Go on from a time to another one, in s."""
        self.n_runs += t == 0.0
        try:
            if self.signals:
                self.signals.apply_in_step(t, end)
            self.instance.step(t, end - t)
            if self.signals:
                self.signals.apply(end, after_event=True)
        except CALL_FAILURES as error:
            raise self.failure(error) from None
        return self.read(end)

    def failure(self, error: Exception) -> HarnessError:
        """Return the error of a run that failed, with the message of the FMU."""
        return HarnessError(self.instance.log.error_message or f"{self.spec.fmu.name}: {error}")

    def follow(self, y: np.ndarray, stop: float = STOP, spacing: float = inf) -> Iterator[Point]:
        """Yield the ends of internal steps from states y until a time in s; a change of mode ends a step.

        With `spacing`, the multiples of this time are among them. A zero of the section is one, and starts a new run.
        """
        point, n, start = self.begin(y), 1, 0.0
        yield point
        for number in range(MAX_STEPS):
            if number % 1000 == 0:
                check_interrupt()
            if point.t >= stop:
                return
            n += point.t == n * spacing
            row = float(self.rows[np.searchsorted(self.rows, point.t, side="right")])
            end = min(max(start + self.t_next, float(np.nextafter(point.t, inf))), stop, n * spacing, row)
            last, point = point, self.step(point.t - start, end - start)._replace(t=end)
            if last.section < 0.0 <= point.section:
                zero = self.locate(last, point, lambda at: at.section)
                point, start = self.begin(zero.y)._replace(t=zero.t, section=0.0), zero.t
            yield point
        raise HarnessError(f"the motion needs more than {MAX_STEPS} steps until t = {point.t:.6g} s")

    def is_return(self, last: Point, point: Point) -> bool:
        """Return whether a motion passes the section between two points of `follow`."""
        if self.section_variable:
            return last.section < 0.0 == point.section
        last_modes, modes = last.modes[self.section_modes], point.modes[self.section_modes]
        return 0 in last_modes and 0 not in modes

    def locate(self, last: Point, point: Point, value: Callable[[Point], float]) -> Point:
        """Return the point between two points at which a value is zero."""
        points, h = [point], point.t - last.t

        def value_after(time: float) -> float:
            self.begin(last.y)
            points[0] = self.step(0.0, time)
            return value(points[0])

        low, high = value(last), value(point)
        if high and low * high < 0.0:
            root = brentq(
                lambda s: low if s == 0.0 else high if s == h else value_after(s), 0.0, h, xtol=1e-15, rtol=1e-15
            )
            value_after(max(float(root), 1e-12 * h))
        return points[0]._replace(t=last.t + points[0].t)

    def differentiate(self, y: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the states (n,) after a time in s, and their derivatives (n, n) by the states y, or NaN."""
        initial = dict(zip(self.initial, self.initial_values(y).tolist(), strict=True))
        spec = replace(
            self.spec,
            values=self.settings | dict(zip(self.varied_names, self.point, strict=True)) | initial,
            outputs=self.states,
            times=np.array([period]),
            stop=period,
            tolerance=self.settings.get(RTOL),
        )
        solution = VariationalRun(self.exchange, self.folder, spec, self.initial).solve()
        slopes = np.where(solution.left[0] == solution.right[0], solution.left[0], np.nan)
        return solution.values[0], slopes.T @ self.inverse

    @cached_property
    def exchange(self) -> FmuInstance:
        """Return an instance for model exchange."""
        return self.resources.enter_context(open_instance(replace(self.spec, exchange=True), self.folder))

    # ---- coordinates

    def read_jacobian(self) -> np.ndarray:
        """Return the derivatives (n, n) of the rates by the states at the present point."""
        unknowns, knowns = (
            [self.variables[name].valueReference for name in names] for names in (self.rates, self.states)
        )
        return np.array(
            [self.instance.fmu.getDirectionalDerivative(unknowns, [reference], [1.0]) for reference in knowns]
        ).T

    def sliding_states(self) -> Iterator[np.ndarray]:
        """Yield states near the start in which no contact sticks: there the speeds are changed by other rates."""
        rates = self.begin(self.start).f
        sizes = sorted({*np.abs(rates).tolist()} - {0.0}) or [1.0]
        different = np.cumsum(self.speeds) * self.speeds  # or bodies stay at rest against each other
        moved_states = [self.start + sign * size * different for size in sizes for sign in (1, -1)]
        yield from (y for y in (self.start, *moved_states) if not self.begin(y).sticks)

    def find_coordinates(self) -> None:
        """Find the coordinates that repeat, and the values of the parameters that set them at the start."""
        for state, is_speed, row in zip(self.states, self.speeds, self.matrix, strict=True):
            if is_speed and not row.any():
                raise self.has_no_start(state)
        name, states = self.spec.fmu.name, [*self.sliding_states()]
        if not states:
            raise HarnessError(f"{name} has a contact that sticks in all states near its start: choose another start")
        rates = self.begin(states[0]).f
        points = (
            point for y in states for point in islice(self.follow(y), 0, SAMPLE_POINTS * 10, 10) if not point.sticks
        )
        jacobians = np.array([self.read_jacobian() for _ in points])
        is_constant = ~jacobians.any(axis=(0, 2))
        self.phase = self.find_phase(is_constant & (rates != 0.0) & jacobians.any(axis=(0, 1)))
        if self.phase is not None and not self.matrix[self.phase].any():
            self.find_phase_parameter(self.phase, states[0])
        self.sets_phase = self.phase is not None and bool(self.matrix[self.phase].any())
        basis = self.find_basis(jacobians)
        candidates = np.flatnonzero(basis.any(axis=1) & ~is_constant)
        if not len(candidates):
            raise HarnessError(f"{name} has no force that depends on a position or a speed, and so no oscillations")
        self.coordinate = int(candidates[0])
        row = basis[self.coordinate]
        self.gauge = basis @ row / (row @ row)
        self.displacement = self.gauge / (self.gauge @ self.gauge)
        self.set_inverse(basis)
        stiffness = np.abs(jacobians[:, self.speeds > 0.0][:, :, self.speeds == 0.0]).max(initial=0.0)
        self.rate = float(np.sqrt(stiffness)) or 1.0
        scales = np.where(basis.T @ self.speeds > 0.0, self.rate, 1.0)
        self.basis, self.reduction = basis * scales, basis.T / scales[:, None]

    def find_phase(self, is_clock: np.ndarray) -> int | None:
        """Return the index of the state that is the phase angle of a force or its clock, of those (n,) that can be."""
        units = np.array([self.units[state] for state in self.states])
        clocks, angles = np.flatnonzero(is_clock & (units == "s")), np.flatnonzero(is_clock & (units == "rad"))
        if self.period is None and len(clocks):
            clock = self.states[clocks[0]]
            raise HarnessError(
                f"{self.spec.fmu.name} has forces that depend on the time {clock}: give their period in s"
            )
        if self.period is not None and not (len(clocks) or self.signals):
            raise HarnessError(
                f"{self.spec.fmu.name} has no forces that depend on a time, and no inputs: remove the period"
            )
        phases = angles if self.period is None else clocks
        return int(phases[0]) if len(phases) else None

    def find_basis(self, jacobians: np.ndarray) -> np.ndarray:
        """Return the coordinates (n, r) of the states except the phase, without translations, which change no rate."""
        unit, is_kept = np.eye(len(self.states)), np.arange(len(self.states)) != self.phase
        positions, speeds = unit[:, is_kept & (self.speeds == 0.0)], unit[:, is_kept & (self.speeds > 0.0)]
        columns = np.concatenate(jacobians) @ positions
        scales = np.linalg.norm(columns, axis=0)
        scales[scales == 0.0] = 1.0
        _, sizes, rows = np.linalg.svd(columns / scales)
        rank = int(np.count_nonzero(sizes > 1e-10 * sizes.max(initial=0.0)))
        if rank < len(scales):
            positions = positions @ np.linalg.qr((rows[:rank] * scales).T)[0]
        return np.hstack([positions, speeds])

    def set_inverse(self, basis: np.ndarray) -> None:
        """Set the values of the start parameters by the states: those of the basis, and the phase if one sets it.

        Translations stay as they are at the start.
        """
        is_phase = (np.arange(len(self.states)) == self.phase) & self.sets_phase
        directions = np.column_stack([basis, np.eye(len(self.states))[:, is_phase]])
        reduced_matrix = directions.T @ self.matrix
        self.inverse = np.linalg.pinv(reduced_matrix) @ directions.T
        for state, remainder in zip(
            self.states, directions @ (reduced_matrix @ np.linalg.pinv(reduced_matrix)) - directions, strict=True
        ):
            if np.abs(remainder).max() > 1e-9:
                raise self.has_no_start(state)

    def has_no_start(self, state: str) -> HarnessError:
        """Return the error of a model without a parameter that sets a state."""
        return HarnessError(
            f"{self.spec.fmu.name}: no parameter sets {state} at the start: declare one, as in start={state}_0 of the "
            f"state, with {state}_0 a Fixed of the model"
        )

    def find_phase_parameter(self, phase: int, y: np.ndarray) -> None:
        """Find the parameter that adds to a phase angle which itself always starts at zero.

        A motion and one that starts with the angle that it has reached then have the same rates.
        """
        first = self.begin(y)
        later = self.step(0.0, 0.3 / abs(first.f[phase]))
        offsets = self.offsets + self.inverse @ (later.y - self.start)
        for j in np.flatnonzero([self.units[name] == "rad" for name in self.initial]):
            turned_offsets = offsets + (later.y[phase] - first.y[phase]) * np.eye(len(self.initial))[j]
            if np.allclose(self.begin_with(turned_offsets).f, later.f, rtol=1e-6, atol=0.0):
                self.phase_matrix[phase, j] = self.matrix[phase, j] = 1.0
                self.start = self.begin_with(self.offsets).y
                return

    @property
    def is_forced(self) -> bool:
        """Return whether forces depend on the time."""
        return self.phase is not None or self.period is not None

    @property
    def forced_period(self) -> float | None:
        """Return the period of the force in s; None without a force."""
        if self.phase is None or self.period is not None:
            return self.period  # of the inputs or of a clock
        return 2.0 * pi / abs(float(self.begin(self.start).f[self.phase]))

    def reduce(self, y: np.ndarray) -> np.ndarray:
        """Return the coordinates (r,) of states or rates."""
        return np.asarray(self.reduction @ y)

    def measure(self, y: np.ndarray) -> float:
        """Return the value, without translations, of the state that measures a motion."""
        return float(self.gauge @ y)

    @property
    def is_one_body(self) -> bool:
        """Return whether this is one body with one contact, whose motions fill a plane."""
        return self.basis.shape[1] == 2 and self.speeds.sum() == 1 and self.n_modes == 1

    # ---- steady sliding

    def find_steady_sliding(self) -> SteadySliding | None:
        """Return steady sliding, by Newton's method."""
        if self.is_forced:
            return None
        for y in chain([] if self.last_equilibrium is None else [self.last_equilibrium], self.sliding_states()):
            for _ in range(MAX_ITERATIONS):
                point = self.begin(y)
                matrix = self.reduction @ self.read_jacobian() @ self.basis
                if point.sticks or not matrix.any():
                    break
                change = self.basis @ np.linalg.lstsq(matrix, -self.reduce(point.f), rcond=None)[0]
                if np.abs(self.reduce(change)).max() <= 1e-15 * np.abs(self.reduce(y)).max():
                    break
                y = y + change
            steady = SteadySliding(y, np.linalg.eigvals(matrix))
            size = max(float(np.abs(self.reduce(states)).max()) for states in (y, self.start))
            smallest = 1e-10 * float(np.abs(steady.eigenvalues).max()) * size
            if not point.sticks and matrix.any() and np.abs(self.reduce(point.f)).max() <= smallest:
                self.begin(y)
                if not self.step(0.0, min(STOP, 1.0 / float(np.abs(steady.eigenvalues).max()))).n_changes:
                    # it slides on, with a speed that is not zero by rounding
                    self.last_equilibrium = y  # a good guess at the next point
                    return steady
        return None


def repeat_inputs(inputs: Mapping[str, Any], period: float | None) -> dict[str, Any]:
    """Return a table of inputs, which covers a period in s, for all periods of a motion.

    Raises
    ------
    SceneError
        If the period is not given, or is not that of the table.
    """
    if not inputs:
        return {}
    time = np.asarray(inputs[TIME], dtype=float)
    if period is None or not (time[0] == 0.0 and abs(time[-1] - period) <= 1e-12 * period):
        span = f"the inputs are a table from {time[0]:g} to {time[-1]:g} s"
        raise SceneError(f"{span}: give the table of one period, from 0 s, and the period")
    numbers = np.arange(PERIODS)[:, None]
    times = np.hstack([period * numbers + time[:-1], period * (numbers + 1)])
    return {TIME: times.ravel()} | {
        name: np.tile(np.asarray(column, dtype=float), PERIODS) for name, column in inputs.items() if name != TIME
    }


def choose_solver(variables: Mapping[str, Any]) -> dict[str, str | float]:
    """Return method and tolerance of the solver, unless a user sets others."""
    if RTOL not in variables:
        return {}
    if METHOD not in variables:
        return {RTOL: DEFAULT_RTOL}
    labels = enumeration_labels(variables[METHOD])
    default = labels[int(variables[METHOD].start)]
    method = METHODS.get(default, default)
    return {RTOL: DEFAULT_RTOL, METHOD: method if method in labels.values() else default}


def find_start_parameters(description: Any, states: Sequence[str]) -> tuple[str, ...]:
    """Return the variables that set the states at the start: states themselves, or fixed parameters of their starts."""
    names = []
    for unknown in description.initialUnknowns:
        if unknown.variable.name in states:
            names += [item.name for item in unknown.dependencies or () if item.variability == "fixed"]
    exact = [item.name for item in description.modelVariables if item.name in states and item.initial == "exact"]
    return tuple(dict.fromkeys([*names, *exact]))
