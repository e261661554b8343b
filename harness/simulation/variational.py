"""Derivatives of the motion of an FMU by its parameters, through events, by the model-exchange interface.

Between events the compiled loop of variational.c integrates the states y and their derivatives S. At an event, where an
indicator g is zero, the derivatives of the event time and of the states are

    dt/dp = -(g_y S + g_p) / (g_y f + g_t),   S_after = R_y (S + f dt/dp) + R_p - f_after dt/dp,

with the states R(y, p) after the event; where the states do not change, S_after = S + (f - f_after) dt/dp (saltation).

References
----------
P. C. Mueller, Calculation of Lyapunov exponents for dynamic systems with discontinuities, Chaos, Solitons & Fractals 5
(1995) 1671-1681; I. A. Hiskens, M. A. Pai, Trajectory sensitivity analysis of hybrid systems, IEEE Transactions on
Circuits and Systems I 47 (2000) 204-220.
"""

from collections.abc import Callable, Sequence
from ctypes import (
    byref,
    c_double,
    c_int,
    c_size_t,
    c_uint32,
    c_void_p,
    cast,
)
from dataclasses import dataclass
from io import StringIO
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from ..errors import HarnessError
from ..process.interrupt import check_interrupt
from ..scenes.run_spec import RunSpec
from .array_elements import ArrayElement, split_own_arrays, start_values
from .event_mode import MAX_EVENTS, update_discrete_states
from .fmu_archive import DESCRIPTION_FILE, read_leniently
from .fmu_instance import CALL_FAILURES, WARNING, FmuInstance, LogCapture
from .model_data import read_model_data
from .stepping import TIME, interpolate
from .variable_values import REAL_TYPES, find_bound
from .variational_loop import (
    EVENT,
    FAILED,
    FUNCTION_FIELDS,
    FUNCTIONS,
    GRAZE,
    REACHED,
    STEP_EVENT,
    TABLEAU,
    TERMINATED,
    TOO_MANY_STEPS,
    ParameterStruct,
    RunStruct,
    load_library,
)
from .variational_solution import EventDerivative, Undefined, VariationalSolution

EXTENDED, DENSE, SAMPLES = 16, 8, 9  # stages with those of the interpolant, rows of two buffers
MAX_STEPS, STEPS_PER_CHECK = 1_000_000, 1000
DEFAULT_RTOL = 1e-11
SHIFT = 1e-3  # of a parameter, or of the largest value of a state, for differences of an event indicator
JUMP_SHIFT = 1e-4  # the same for differences of the states after an event
NEAR = 1e-10  # of the duration: times this close coincide
TOUCH = 1e-9  # of the largest value of an indicator: one that turns this close to zero touches it
SAME = 1e-5  # relative difference of derivatives that are the same
TIGHTER = 1e-3  # factor of the tolerance that the FMU receives, for its own decisions on events
MODE_UPDATES = 3  # until an FMU has the modes of a point: from sliding against its mode it first sticks
RESET = 100.0  # in tolerances: smaller changes of the states at an event are errors of the integration


@dataclass
class Known:
    """A parameter: its variable, all values of its array, and how it is changed.

    Attributes
    ----------
    variable, array, element
        Its variable, the values of its array, or its value alone, and its index among these.
    state : int
        Index of the state whose start value it is, or -1.
    input : int
        Index of the driven input whose factor it is, or -1.
    side : int or None
        Whether the FMU takes both neighbouring values (0), or only larger (1) or smaller (-1) ones; None if it takes
        none, or cannot be changed after the start.
    """

    variable: Any
    array: np.ndarray
    element: int
    state: int
    input: int
    side: int | None = None

    @property
    def value(self) -> float:
        """Return the value."""
        return float(self.array[self.element])

    @property
    def is_set(self) -> bool:
        """Return whether it is changed by setting its variable."""
        return self.state < 0 and self.input < 0

    @property
    def is_tunable(self) -> bool:
        """Return whether its variable can be set at an event."""
        return self.is_set and (self.variable.variability == "tunable" or self.variable.causality == "input")

    @property
    def shift(self) -> float:
        """Return the largest change for differences of an event indicator."""
        return SHIFT * abs(self.value) or SHIFT


def has_capability(folder: Path, *names: str) -> bool:
    """Return whether an unpacked FMU has a capability for model exchange, by its names in FMI 2.0 and 3.0."""
    interface = etree.parse(str(folder / DESCRIPTION_FILE)).getroot().find("ModelExchange")  # fmpy reads FMI 2.0 only
    return interface is not None and any(interface.get(name) in ("true", "1") for name in names)


def has_derivatives(folder: Path) -> bool:
    """Return whether an unpacked FMU has directional derivatives for model exchange."""
    return has_capability(folder, "providesDirectionalDerivative", "providesDirectionalDerivatives")


def state_variables(description: Any) -> list[Any]:
    """Return the variables of the continuous states."""
    return [unknown.variable.derivative for unknown in description.derivatives]


class VariationalRun:
    """Integrates an instance for model exchange, and the derivatives of its states by parameters.

    Parameters
    ----------
    instance : FmuInstance
        Instance for model exchange, whose FMU has directional derivatives.
    folder : pathlib.Path
        Directory of the unpacked FMU.
    spec : RunSpec
        The run, with converted values and its start and stop; its `outputs` are recorded at its `times`, and its
        `tolerance` is that of the integration.
    parameters : sequence of str
        Parameters, constant inputs, driven inputs (the factor of the signal), or states whose start values can be set.
    """

    def __init__(self, instance: FmuInstance, folder: Path, spec: RunSpec, parameters: Sequence[str]) -> None:
        assert spec.start is not None
        assert spec.stop is not None
        self.instance, self.fmu, self.spec, self.parameters = instance, instance.fmu, spec, tuple(parameters)
        self.start, self.stop, self.library = spec.start, spec.stop, load_library()
        self.tolerance = NEAR * (self.stop - self.start)
        description, variables = instance.description, instance.variables
        self.can_save = has_capability(folder, "canGetAndSetFMUstate", "canGetAndSetFMUState")
        states = state_variables(description)
        rates = [unknown.variable for unknown in description.derivatives]
        self.inputs = [variables[name] for name in spec.inputs if name != TIME]
        self.columns = {name: np.asarray(column, dtype=float) for name, column in spec.inputs.items()}
        self.settings = {variables[name]: value for name, value in spec.values.items()}
        self.knowns = [self.select_known(variables[name], states) for name in parameters]
        calculated = {unknown.variable.name for unknown in description.initialUnknowns}
        self.calculated = [i for i, state in enumerate(states) if state.name in calculated]
        self.modes = tuple(read_model_data(spec.fmu).contacts.values())
        self.update = self.fmu.newDiscreteStates if instance.is_fmi2 else self.fmu.updateDiscreteStates
        self.n, self.m, self.q = len(states), len(parameters), int(description.numberOfEventIndicators or 0)
        self.allocate({"states": states, "rates": rates, "inputs": self.inputs})

    def select_known(self, variable: Any, states: Sequence[Any]) -> Known:
        """Return what is needed of a parameter."""
        if variable in states:
            value = float(self.settings.get(variable, variable.start))
            return Known(variable, np.array([value]), 0, states.index(variable), -1)
        if variable in self.inputs:
            return Known(variable, np.ones(1), 0, -1, self.inputs.index(variable))
        if isinstance(variable, ArrayElement):
            values = np.array(start_values(variable.array))
            for other, value in self.settings.items():
                if isinstance(other, ArrayElement) and other.array is variable.array:
                    values[other.index] = value
            return Known(variable, values, variable.index, -1, -1)
        return Known(variable, np.array([float(self.settings.get(variable, variable.start or 0.0))]), 0, -1, -1)

    def allocate(self, groups: dict[str, list[Any]]) -> None:
        """Allocate the buffers of the loop."""
        from scipy.integrate import DOP853

        instance, n, m, q, is_fmi2 = self.instance, self.n, self.m, self.q, self.instance.is_fmi2
        size, widest = max(n * (1 + m), 1), max((len(known.array) for known in self.knowns), default=1)
        self.times = np.asarray(self.spec.times, dtype=float)
        self.arrays: dict[str, np.ndarray] = {
            "k": np.zeros((EXTENDED, size)),
            "dense": np.zeros((DENSE, size)),
            "nominals": np.ones(max(n, 1)),
            "samples": np.zeros((SAMPLES, max(q, 1))),
            "work": np.zeros(len(self.inputs) + 2 * n + widest + 2),
            "times": self.times,
            # the last row is for one-sided derivatives at an event
            "values": np.full((len(self.times) + 1, 1 + m, len(self.spec.outputs)), nan),
            "table": np.zeros((2, 1 + len(self.inputs))),
        }
        self.arrays |= {name: np.zeros(size) for name in ("z", "z1", "largest", "touch")}
        self.arrays |= {name: np.zeros(max(q, 1)) for name in ("g", "g1", "largest_g", "t_far", "g_far")}
        self.arrays |= {name: np.ascontiguousarray(getattr(DOP853, key)) for name, key in TABLEAU.items()}
        groups["outputs"] = [instance.variables[name] for name in self.spec.outputs]
        self.references = {name: instance.make_references(group) for name, group in groups.items()}
        self.structs = (ParameterStruct * max(m, 1))()
        for struct, known in zip(self.structs, self.knowns, strict=False):
            struct.reference, struct.element, struct.input = known.variable.valueReference, known.element, known.input
            struct.width, struct.value = 0 if known.state >= 0 else len(known.array), known.value
        run = self.run = RunStruct(instance=instance.component, fmi=2 if is_fmi2 else 3, n=n, m=m, q=q)
        run.r, run.n_inputs, run.n_times = len(self.spec.outputs), len(self.inputs), len(self.times)
        names = [*FUNCTIONS[instance.description.fmiVersion], "GetDirectionalDerivative"]
        not_needed = is_fmi2 and instance.interface.completedIntegratorStepNotNeeded
        if not not_needed and (is_fmi2 or instance.interface.needsCompletedIntegratorStep):
            names.append("CompletedIntegratorStep")
        for field, name in zip(FUNCTION_FIELDS, names, strict=False):
            setattr(run, field, cast(instance.function(name), c_void_p))
        for field, references in {**self.references, "parameters": self.structs}.items():
            setattr(run, field, cast(references, c_void_p))
        for field, array in self.arrays.items():
            setattr(run, field, array.ctypes.data)
        run.rtol, run.graze = self.spec.rtol, TOUCH
        self.y = self.arrays["z"][:n]
        self.slopes = self.arrays["z"][n : n * (1 + m)].reshape(m, n)  # of the states, by parameter
        self.sizes, self.largest_g = self.arrays["largest"][:n], self.arrays["largest_g"][:q]

    # ---- calls of the FMU

    def read(self, name: str, count: int) -> np.ndarray:
        """Return values (count,) that a function of the FMU writes into an array."""
        values = np.zeros(count)
        if count:
            self.call(name, c_void_p(values.ctypes.data), c_size_t(count))
        return values

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the library with arguments of ctypes; raise HarnessError if it fails."""
        function = self.fmu.dll[f"{self.instance.prefix}{name}"]  # without declared types, which exclude buffers
        if function(self.instance.component, *arguments) > WARNING:
            raise self.failure(f"{name} fails at t = {self.run.t:.9g} s")

    def read_point(self) -> tuple[np.ndarray, np.ndarray, tuple[int, ...]]:
        """Move to the present point; return rates (n,), indicators (q,) and modes of contacts."""
        self.move_to(self.run.t, self.y)
        names = FUNCTIONS["2.0" if self.instance.is_fmi2 else "3.0"]
        modes = tuple(self.instance.get(name) for name in self.modes)
        return self.read(names[2], self.n), self.read(names[3], self.q), modes

    def move_to(self, t: float, y: np.ndarray) -> None:
        """Set time in s, driven inputs and states."""
        self.library.set_point(byref(self.run), c_double(t), c_void_p(np.ascontiguousarray(y).ctypes.data))

    def start_slopes(self, known: Known) -> np.ndarray:
        """Return the derivatives (n,) of the states at the start, in initialization mode."""
        slopes, count = np.zeros(self.n), len(self.calculated)
        if known.state >= 0:
            slopes[known.state] = 1.0
        elif known.is_set and count:
            unknowns = (c_uint32 * count)(*(self.references["states"][i] for i in self.calculated))
            slopes[self.calculated] = self.derive(known, unknowns, count)
        return slopes

    def derive(self, known: Known, unknowns: Any, count: int) -> np.ndarray:
        """Return the partial derivatives (count,) of unknowns by a parameter."""
        seed, values = np.zeros(len(known.array)), np.zeros(count)
        seed[known.element] = 1.0
        pointers: list[Any] = [c_void_p(array.ctypes.data) for array in (seed, values)]
        if not self.instance.is_fmi2:
            pointers = [pointers[0], c_size_t(len(seed)), pointers[1], c_size_t(count)]
        arguments = (unknowns, c_size_t(count), (c_uint32 * 1)(known.variable.valueReference), c_size_t(1))
        self.call("GetDirectionalDerivative", *arguments, *pointers)
        return values

    def failure(self, reason: str) -> HarnessError:
        """Return the error of a run that failed, with the message of the FMU if there is one."""
        return HarnessError(self.instance.log.error_message or f"{self.spec.fmu.name}: {reason}")

    def initialize(self, changed: Known | None = None, value: float = 0.0) -> None:
        """Enter the initialization of the instance, with another value of one parameter."""
        settings = self.settings | ({changed.variable: value} if changed else {})
        self.instance.restart()
        stop = self.stop + 2.0 * self.tolerance
        self.instance.enter_initialization(settings.items(), self.start, stop, TIGHTER * self.spec.rtol)
        self.set_table(self.start)

    def set_table(self, t: float) -> float:
        """Set the driven inputs to their values from a time in s on; return the next time of their table."""
        if not self.inputs:
            return inf
        time = self.columns[TIME]
        later = time[time > t]
        ends = (t, float(later[0]) if len(later) else t + 1.0)
        for row, end, side in zip(self.arrays["table"], ends, ("right", "left"), strict=True):
            row[0] = end
            row[1:] = [interpolate(time, self.columns[v.name], np.array([end]), side)[0] for v in self.inputs]  # type: ignore[arg-type]
        for variable, value in zip(self.inputs, self.arrays["table"][0, 1:].tolist(), strict=True):
            self.instance.set(variable, value)
        return ends[1] if len(later) else inf

    # ---- the run

    def start_indicators(self, known: Known | None = None, change: float = 0.0) -> np.ndarray | None:
        """Return the event indicators (q,) at the start of a run with a changed parameter; None if the FMU refuses."""
        if known:
            low, high = find_bound(known.variable, "min"), find_bound(known.variable, "max")
            value = known.value + change
            if (low is not None and value < low) or (high is not None and value > high):
                return None
        try:
            self.initialize(known, known.value + change if known else 0.0)
            self.fmu.exitInitializationMode()
            update_discrete_states(self.update, self.start)
            self.fmu.enterContinuousTimeMode()
        except CALL_FAILURES:
            if known is None:
                raise
            return None
        return self.read(FUNCTIONS["2.0"][3], self.q)

    def find_side(self, known: Known) -> int | None:
        """Return which neighbouring values of a parameter the FMU takes, as `Known.side`."""
        sides = [side for side in (1, -1) if self.start_indicators(known, side * known.shift) is not None]
        return 0 if len(sides) == 2 else sides[0] if sides else None

    def starts_otherwise(self, known: Known, base: np.ndarray) -> bool:
        """Return whether neighbouring start values lead to other modes, so that an indicator (q,) jumps."""
        for side in (1.0, -1.0):
            near, nearer = (self.start_indicators(known, side * h * known.shift) for h in (1.0, 1.0 / 16.0))
            if near is not None and nearer is not None:
                jump = np.abs(nearer - base)
                if np.any((jump > 0.5 * np.abs(near - base)) & (jump > 1e-6 * np.abs(base))):
                    return True
        return False

    def begin(self) -> None:
        """Initialize the instance and the derivatives of its states."""
        base = self.start_indicators()
        assert base is not None
        for known in self.knowns if self.q else ():
            known.side = self.find_side(known) if known.is_set else None
        self.initialize()
        for i, known in enumerate(self.knowns):
            self.slopes[i] = self.start_slopes(known)
        moved = [known for known, slopes in zip(self.knowns, self.slopes, strict=True) if self.q and slopes.any()]
        if moved:
            jumps = [known for known in moved if known.input < 0 and self.starts_otherwise(known, base)]
            self.initialize()
        self.fmu.exitInitializationMode()
        before = self.read("GetContinuousStates", self.n)
        self.next_event = update_discrete_states(self.update, self.start)
        self.fmu.enterContinuousTimeMode()
        self.y[:] = self.read("GetContinuousStates", self.n)
        self.arrays["nominals"][: self.n] = self.read("GetNominalsOfContinuousStates", self.n)
        run = self.run
        run.t, run.h, run.next, run.n_steps, run.n_rhs = self.start, 1e-3 * (self.stop - self.start), 0, 0, 0
        run.is_fresh = False
        self.arrays["largest"][:] = np.abs(self.arrays["z"])
        self.largest_g[:] = 0.0
        self.events: list[EventDerivative] = []
        self.undefined: list[Undefined] = []
        self.sides = np.zeros(self.m)  # 0: derivatives exist; 1 or -1: for an increase or a decrease alone; NaN: none
        self.side_rows: list[tuple[int, np.ndarray]] = []  # number of rows before the sides changed
        self.one_sided: list[tuple[int, np.ndarray, np.ndarray]] = []  # row, derivatives from the left and right
        if np.any(np.abs(self.y - before) > RESET * self.spec.rtol * np.abs(before)):
            self.undefine(-1, "the states change at the start", np.full(self.m, nan))
        others = np.array([nan if moved and known in jumps else 0.0 for known in self.knowns])
        self.undefine(-1, "nearby values start in another mode", others)
        self.check_ties(-1, np.zeros(self.m), 0.0)

    def solve(self, report: Callable[[float], object] = lambda share: None) -> VariationalSolution:
        """Integrate from start to stop.

        Raises
        ------
        HarnessError
            If the FMU fails, or its equations cannot be integrated or differentiated.
        """
        self.begin()
        run, row, last_t, n_at_once = self.run, self.set_table(self.start), self.start, 0
        end = self.stop + self.tolerance  # an event at the stop is found
        while run.t < end:
            check_interrupt()
            report(min(1.0, (run.t - self.start) / (self.stop - self.start)))
            target = min(end, row, self.next_event)
            run.max_steps = run.n_steps + STEPS_PER_CHECK
            status = self.library.advance(byref(run), c_double(target))
            if status == TOO_MANY_STEPS and run.n_steps < MAX_STEPS:
                continue
            if status > GRAZE:
                raise self.failure(self.describe_status(status))
            if status == GRAZE:
                self.handle_touch(int(run.indicator))
            elif status == EVENT or target < end:
                self.handle_event(int(run.indicator) if status == EVENT else -1, status == REACHED and target == row)
                row = self.set_table(run.t) if run.t >= row else row
            is_at_once = run.t - last_t <= NEAR * (self.stop - self.start)
            n_at_once, last_t = (n_at_once + 1, last_t) if is_at_once else (0, run.t)
            if n_at_once > MAX_EVENTS:
                raise self.failure(f"{MAX_EVENTS} events at t = {run.t:.9g} s")
        return self.make_solution()

    def describe_status(self, status: int) -> str:
        """Return why the loop ended."""
        at = f"at t = {self.run.t:.9g} s"
        return {
            STEP_EVENT: f"it has an event {at} that no event indicator locates",
            TERMINATED: f"it ends the simulation {at}",
            FAILED: f"its equations, or their derivatives, have no finite values {at}",
            TOO_MANY_STEPS: f"it needs more than {MAX_STEPS} steps, {at}: choose an earlier stop or a larger rtol",
        }[status]

    def make_solution(self) -> VariationalSolution:
        """Return the solution up to the stop."""
        rows = self.arrays["values"][: len(self.times)]
        left, right = rows[:, 1:].copy(), rows[:, 1:].copy()
        for begin, sides in self.side_rows:
            left[begin:, (sides == 1.0) | np.isnan(sides)] = nan
            right[begin:, (sides == -1.0) | np.isnan(sides)] = nan
        for index, before, after in self.one_sided:
            left[index], right[index] = before, after
        used = np.asarray(rows[:, 1:].any(axis=(0, 2)) | self.slopes.any(axis=1))
        for event in self.events:
            used |= event.slopes != 0.0
        for item in self.undefined:
            used |= np.isin(self.parameters, item.parameters)
        counts = int(self.run.n_steps), int(self.run.n_rhs)
        return VariationalSolution(rows[:, 0].copy(), left, right, used, (*self.events,), (*self.undefined,), *counts)

    # ---- events

    def handle_event(self, indicator: int, is_row: bool) -> None:
        """Handle an event at the present time: of an indicator, or at a time that the FMU or a table sets (-1)."""
        t, y = self.run.t, self.y.copy()
        early = self.record_outputs() if (row := self.row_at(t)) is not None else None
        rates, values, modes = self.read_point()
        e = self.time_shift(rates)
        drift = (self.move_indicators(e, rates) - self.move_indicators(-e, rates)) / (2.0 * e)
        due = [k for k in range(self.q) if drift[k] != 0.0 and abs(values[k]) <= abs(drift[k]) * self.tolerance]
        if not (is_located := indicator >= 0) and due and not is_row:
            indicator = due[0]
        fired = [indicator, *(k for k in due if k != indicator)] if indicator >= 0 else []
        self.move_to(t, y)
        saved = self.save()
        gradients = self.gradients(fired, rates)
        slopes = [np.where(g[:-1] == 0.0, 0.0, -g[:-1] / (g[-1] or nan)) for g in gradients]
        of_event = slopes[0] if fired else np.zeros(self.m)
        if is_row:
            self.set_table(t)
        self.next_event = update_discrete_states(self.update, t)
        new = self.read("GetContinuousStates", self.n)
        self.fmu.enterContinuousTimeMode()
        if jumps := bool(np.any(np.abs(new - y) > RESET * self.spec.rtol * self.sizes)):
            moved = self.jump_slopes(saved, y, rates, of_event)
        if saved is not None:
            self.fmu.freeFMUState(saved)
        self.y[:] = new
        self.run.is_fresh = False
        new_rates, _, new_modes = self.read_point()
        differs = np.abs(new_rates - rates) > RESET * self.spec.rtol * np.maximum(np.abs(new_rates), np.abs(rates))
        if not (jumps or new_modes != modes or differs.any()):
            return
        if jumps:
            self.slopes[:] = moved - np.outer(of_event, new_rates)
        else:
            self.slopes += np.outer(of_event, rates - new_rates)
        if not fired:
            if not is_row:
                self.undefine(-1, "no event indicator shows the event", np.full(self.m, nan))
            return
        for k, other in zip(fired[1:], slopes[1:], strict=True):
            is_same = np.abs(other - of_event) <= SAME * np.maximum(np.abs(other), np.abs(of_event))
            self.undefine(k, "two events happen at once", np.where(is_same, 0.0, nan))
        speed = float(gradients[0][-1])
        if is_located and self.turning_depth(indicator, speed) <= TOUCH * self.largest_g[indicator]:
            self.undefine(indicator, "the event happens only just", np.full(self.m, nan))
        self.events.append(EventDerivative(t, indicator, modes, new_modes, of_event))
        self.check_ties(indicator, of_event, speed)
        if row is not None and early is not None:
            self.split_row(row, of_event, indicator, early, self.record_outputs())

    def handle_touch(self, k: int) -> None:
        """Note the parameters that decide whether indicator k, which touches zero without an event, passes it."""
        sides, saved = np.full(self.m, nan), self.save()
        if saved is not None:
            t, z = self.run.t, self.arrays["z"].copy()
            self.run.t, self.arrays["z"][:] = self.run.t_event, self.arrays["touch"]
            rates, values, _ = self.read_point()
            slopes = self.gradients([k], rates)[0][:-1]
            sizes = np.array([abs(known.value) or 1.0 for known in self.knowns])
            is_zero = np.abs(slopes) * sizes <= SAME * self.largest_g[k]
            sides = np.where(is_zero, 0.0, np.sign(slopes) * np.sign(values[k]))
            self.run.t, self.arrays["z"][:] = t, z
            self.fmu.setFMUState(saved)
            self.fmu.freeFMUState(saved)
            self.run.is_fresh = False
            self.read_point()
        self.undefine(k, "a limit is touched, but not passed", sides, self.run.t_event)

    def turning_depth(self, k: int, speed: float) -> float:
        """Return how far an indicator that passes zero at a speed goes until it turns, by a parabola; inf if never."""
        elapsed, far = self.run.t - self.arrays["t_far"][k], abs(self.arrays["g_far"][k])
        curvature = 2.0 * (far - abs(speed) * elapsed) / elapsed**2 if elapsed > 0.0 else 0.0
        return 0.5 * speed * speed / curvature if curvature > 0.0 else inf

    def time_shift(self, rates: np.ndarray) -> float:
        """Return a time in s in which the states (n,) with these rates hardly change."""
        share = float((np.abs(rates) / self.usual_sizes).max(initial=0.0))
        return SHIFT / share if share else SHIFT * (self.stop - self.start)

    @property
    def usual_sizes(self) -> np.ndarray:
        """Return the largest values (n,) of the states up to now, if they are not tiny."""
        return np.maximum(self.sizes, 1e-6 * self.arrays["nominals"][: self.n])

    def move_indicators(self, e: float, rates: np.ndarray) -> np.ndarray:
        """Return the indicators (q,) after e seconds of motion with these rates."""
        pointer = c_void_p(np.ascontiguousarray(rates).ctypes.data)
        self.library.moved_indicator(byref(self.run), c_size_t(0), c_size_t(self.m), c_double(e), pointer, None)
        return self.arrays["g1"][: self.q].copy()

    def gradients(self, indicators: Sequence[int], rates: np.ndarray, is_before: bool = True) -> list[np.ndarray]:
        """Return the total derivatives (m + 1,) of indicators by the parameters and by time; enter event mode.

        The present point is just before an event, or just after it.
        """
        result = [np.zeros(self.m + 1) for _ in indicators]
        pointer = c_void_p(np.ascontiguousarray(rates).ctypes.data)
        run, slope = byref(self.run), self.library.indicator_slope
        shift = c_double(self.time_shift(rates))
        for k, gradient in zip(indicators, result, strict=True):
            for i, known in enumerate(self.knowns):
                shares = np.abs(self.slopes[i]) / self.usual_sizes
                if known.input >= 0 or shares.any():
                    e = min(SHIFT / float(shares.max()) if shares.any() else inf, SHIFT if known.input >= 0 else inf)
                    gradient[i] = slope(run, c_size_t(k), c_size_t(i), c_double(e), 0, pointer, None)
            gradient[-1] = slope(run, c_size_t(k), c_size_t(self.m), shift, 0, pointer, None)
        for i, known in enumerate(self.knowns if indicators else ()):
            if known.is_set and not known.is_tunable:
                slopes = self.fixed_slopes(known, rates, -1.0 if is_before else 1.0)
                if slopes is None and is_before and self.enters_outputs(known):
                    self.undefine(indicators[0], "the event may depend on a fixed parameter", self.only(i))
                for k, gradient in zip(indicators, result, strict=True):
                    gradient[i] += 0.0 if slopes is None else slopes[k]
        self.move_to(self.run.t, self.y)
        self.fmu.enterEventMode()
        for k, gradient in zip(indicators, result, strict=True):
            for i, known in enumerate(self.knowns):
                if known.is_tunable:
                    if known.side is None:
                        raise self.failure(f"it takes no value next to {known.variable.name} = {known.value!r}")
                    values, side = c_void_p(known.array.ctypes.data), c_int(known.side)
                    gradient[i] += slope(run, c_size_t(k), c_size_t(i), c_double(known.shift), side, pointer, values)
            if not np.isfinite(gradient).all():
                raise self.failure(f"an event indicator has no finite values at t = {self.run.t:.9g} s")
        return result

    def only(self, i: int) -> np.ndarray:
        """Return sides without derivatives by parameter i."""
        return np.where(np.arange(self.m) == i, nan, 0.0)

    def fixed_slopes(self, known: Known, rates: np.ndarray, side: float) -> np.ndarray | None:
        """Return the partial derivatives (q,) of the indicators by a parameter that can be set before the start only.

        For each value the FMU is initialized again, and moved to the present point in the present modes, which it takes
        at a point just before (`side` -1) or after (1). None if it takes others, or cannot save its state.
        """
        saved = self.save() if known.side is not None else None
        if saved is None:
            return None
        t, y, ahead = self.run.t, self.y.copy(), 10.0 * side * self.time_shift(rates)
        values, table = self.read_point()[1], self.arrays["table"].copy()

        def indicators(change: float) -> np.ndarray:
            self.initialize(known, known.value + change)
            self.fmu.exitInitializationMode()
            update_discrete_states(self.update, self.start)
            self.fmu.enterContinuousTimeMode()
            self.arrays["table"][:] = table
            for _ in range(MODE_UPDATES):
                self.move_to(t + ahead, y + ahead * rates)
                self.fmu.enterEventMode()
                update_discrete_states(self.update, t + ahead)
                self.fmu.enterContinuousTimeMode()
            return self.read_point()[1]

        result, base, e = None, indicators(0.0), 1e-2 * known.shift
        if np.allclose(base, values, rtol=1e-9, atol=1e-12):
            if known.side:  # one-sided differences
                near, far = ((indicators(known.side * h) - base) / (known.side * h) for h in (0.5 * e, e))
                result = 2.0 * near - far
            else:
                near, far = ((indicators(h) - indicators(-h)) / (2.0 * h) for h in (0.5 * e, e))
                result = (4.0 * near - far) / 3.0
            if not np.allclose(near, far, rtol=1e-3, atol=1e-6 * np.abs(far).max()):
                result = None
        self.fmu.setFMUState(saved)
        self.fmu.freeFMUState(saved)
        self.read_point()
        return result

    def enters_outputs(self, known: Known) -> bool:
        """Return whether a rate or an output depends on a parameter directly, at the present point."""
        outputs = [unknown.variable for unknown in self.instance.description.outputs]
        unknowns = [variable.valueReference for variable in outputs if variable.type in REAL_TYPES]
        unknowns += self.references["rates"]
        return bool(self.derive(known, (c_uint32 * len(unknowns))(*unknowns), len(unknowns)).any())

    def save(self) -> Any:
        """Return the saved state of the FMU, None if it cannot be saved."""
        return self.fmu.getFMUState() if self.can_save else None

    def jump_slopes(self, saved: Any, y: np.ndarray, rates: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Return the derivatives (m, n) of the states just after an event that changes them, at the moving event time.

        They are differences between points that have just passed the event, extrapolated to the event itself.
        """
        if saved is None:
            raise self.failure(f"its states jump at t = {self.run.t:.9g} s, and it cannot save its state")
        result, delay = np.zeros((self.m, self.n)), 10.0 * JUMP_SHIFT**2 * self.run.h
        for i, known in enumerate(self.knowns):
            direction = self.slopes[i] + rates * slopes[i]
            share = float((np.abs(direction) / self.usual_sizes).max(initial=0.0))
            e = JUMP_SHIFT / share if share else inf
            e = min(e, JUMP_SHIFT * (abs(known.value) or 1.0)) if known.is_tunable else e
            if e < inf:
                near, far = (
                    self.states_after(saved, y, rates, known, direction, e, float(slopes[i]), late)
                    - self.states_after(saved, y, rates, known, direction, -e, float(slopes[i]), late)
                    for late in (delay, 2.0 * delay)
                )
                result[i] = (2.0 * near - far) / (2.0 * e)
        self.states_after(saved, y, rates, None, np.zeros(self.n), 0.0, 0.0, 0.0)
        return result

    def states_after(
        self,
        saved: Any,
        y: np.ndarray,
        rates: np.ndarray,
        known: Known | None,
        direction: np.ndarray,
        e: float,
        slope: float,
        delay: float,
    ) -> np.ndarray:
        """Return the states after the event of a run with a parameter changed by e, `delay` s after it happens."""
        self.fmu.setFMUState(saved)
        t = self.run.t + e * slope + delay
        self.move_to(t, y + e * direction + delay * rates)
        self.fmu.enterEventMode()
        if known and known.is_tunable:
            self.instance.set(known.variable, known.value + e)
        self.next_event = update_discrete_states(self.update, t)
        states = self.read("GetContinuousStates", self.n)
        self.fmu.enterContinuousTimeMode()
        return states

    # ---- where no derivative exists

    def undefine(self, indicator: int, reason: str, sides: np.ndarray, t: float | None = None) -> None:
        """Note that derivatives do not exist from a time in s on (0: they do; 1, -1: for one side; NaN: for none)."""
        if not (concerned := (sides != 0.0) & ~np.isnan(self.sides)).any():
            return
        names = tuple(name for name, is_one in zip(self.parameters, concerned, strict=True) if is_one)
        t = self.run.t if t is None else t
        self.undefined.append(Undefined(t, indicator, reason, names))
        agree = (self.sides == 0.0) | (self.sides == sides)
        self.sides = np.where(concerned, np.where(agree, sides, nan), self.sides)
        self.side_rows.append((int(np.searchsorted(self.times, t - self.tolerance)), self.sides))

    def check_ties(self, fired: int, slopes: np.ndarray, speed: float) -> None:
        """Note the parameters that decide what happens next, because an indicator is zero just after an event."""
        rates, values, _ = self.read_point()
        e = self.time_shift(rates)
        reach = np.abs(self.move_indicators(e, rates) - self.move_indicators(-e, rates)) / SHIFT
        self.read_point()
        near = [k for k in range(self.q) if abs(values[k]) <= TOUCH * max(self.largest_g[k], reach[k])]
        if not near:
            return
        for k, gradient in zip(near, self.gradients(near, rates, is_before=False), strict=True):
            drift, moved = gradient[-1], gradient[-1] * slopes
            if k == fired and abs(drift) <= TOUCH * abs(speed):
                self.undefine(k, "sticking and sliding on are both possible", np.full(self.m, nan))
            change = gradient[:-1] + moved
            sizes = np.array([abs(known.value) or 1.0 for known in self.knowns])
            is_zero = np.abs(change) * sizes <= TOUCH * max(self.largest_g[k], reach[k])
            sides = np.sign(change) * (1.0 if values[k] > 0.0 else -1.0)
            self.undefine(k, "two modes are possible", np.where(is_zero, 0.0, sides))
        update_discrete_states(self.update, self.run.t)
        self.fmu.enterContinuousTimeMode()
        self.read_point()

    def row_at(self, t: float) -> int | None:
        """Return the index of the recorded time at a time in s, None if there is none."""
        near = np.flatnonzero(np.abs(self.times - t) <= self.tolerance)
        return int(near[0]) if len(near) else None

    def record_outputs(self) -> np.ndarray:
        """Return the outputs and their derivatives (1 + parameters, outputs) at the present point."""
        count, following = len(self.times), self.run.next
        self.run.next = count
        pointer = c_void_p(self.arrays["z"].ctypes.data)
        self.library.record(byref(self.run), c_double(self.run.t), pointer)
        self.run.next = following
        return self.arrays["values"][count].copy()

    def split_row(self, row: int, slopes: np.ndarray, indicator: int, early: np.ndarray, late: np.ndarray) -> None:
        """Note the one-sided derivatives at a recorded time at which an event happens.

        `early` and `late` (1 + parameters, outputs) are the outputs and their derivatives before and after the event.
        """
        jumps = np.abs(late[0] - early[0]) > self.spec.rtol * np.abs(early[0])
        is_delayed = (slopes > 0.0)[:, None]  # by an increase of the parameter
        after = np.where(jumps & (slopes != 0.0)[:, None], nan, late[1:])
        sides = np.where(is_delayed, after, early[1:]), np.where(is_delayed, early[1:], after)
        self.one_sided.append((row, *sides))
        if (concerned := (sides[0] != sides[1]).any(axis=1)).any():
            names = tuple(np.array(self.parameters)[concerned].tolist())
            self.undefined.append(Undefined(float(self.times[row]), indicator, "an event happens then", names, True))


def differentiate(
    spec: RunSpec,
    folder: Path,
    parameters: tuple[str, ...],
    stderr: StringIO | None = None,
    report: Callable[[float], object] = lambda share: None,
) -> VariationalSolution:
    """Run an unpacked FMU with derivatives; see `VariationalRun`.

    Parameters
    ----------
    stderr : StringIO or None
        Captured standard error, which has the messages of the FMU.
    report : callable
        Receives the progress from 0 to 1.
    """
    description = split_own_arrays(read_leniently(folder))
    try:
        instance = FmuInstance(description, folder, exchange=True, name=spec.model, log=LogCapture(stderr))
    except HarnessError as error:
        raise HarnessError(f"{spec.fmu.name} cannot be loaded: {error}") from None
    try:
        return VariationalRun(instance, folder, spec, parameters).solve(report)
    except CALL_FAILURES as error:
        raise HarnessError(instance.log.error_message or f"{spec.fmu.name}: {error}") from None
    finally:
        instance.close()
