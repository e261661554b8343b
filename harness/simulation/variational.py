"""Derivatives of the motion of an FMU by its parameters, through events, by the model-exchange interface.

A compiled loop integrates the states y and their derivatives S (variational.c) from event to event
(variational_events.c). At an event, where an indicator g is zero, the derivatives of the event time and the states are

    dt/dp = -(g_y S + g_p) / (g_y f + g_t),   S_after = R_y (S + f dt/dp) + R_p - f_after dt/dp,

with the states R(y, p) after the event; where the states do not change, S_after = S + (f - f_after) dt/dp (saltation).

References
----------
P. C. Mueller, Calculation of Lyapunov exponents for dynamic systems with discontinuities, Chaos, Solitons & Fractals 5
(1995) 1671-1681; I. A. Hiskens, M. A. Pai, Trajectory sensitivity analysis of hybrid systems, IEEE Transactions on
Circuits and Systems I 47 (2000) 204-220.
"""

from collections.abc import Callable, Mapping, Sequence
from ctypes import byref, c_double, c_int64, c_uint32, c_void_p, cast
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
from .event_mode import MAX_EVENTS, update_discrete_states
from .fmu_archive import DESCRIPTION_FILE, read_leniently
from .fmu_instance import CALL_FAILURES, FmuInstance, LogCapture
from .model_data import read_model_data
from .stepping import TIME
from .variable_values import REAL_TYPES, find_bound, variable_unit
from .variational_loop import (
    EARLY_EVENT,
    EVENT_TERMINATED,
    FAILED,
    FIXED,
    FUNCTIONS,
    LOG_FULL,
    NO_END,
    NO_NEIGHBOUR,
    NO_SAVED_STATE,
    NO_SIDE,
    NO_VALUE,
    NOT_SET,
    REACHED,
    REASONS,
    RECORDED,
    STEP_EVENT,
    TABLEAU,
    TERMINATED,
    TOO_MANY_STEPS,
    TUNABLE,
    UNSETTLED,
    ParameterStruct,
    RunStruct,
    load_library,
)
from .variational_solution import EventDerivative, UndefinedDerivative, VariationalSolution

EXTENDED_STAGES, DENSE, SAMPLES = 16, 8, 9  # stages with those of the interpolant, rows of two buffers
MAX_STEPS, STEPS_PER_CHECK = 1_000_000, 1000
LOG_SIZE = 64  # events until the logs are read
DEFAULT_RTOL = 1e-11
SHIFT = 1e-3  # of a parameter, for differences of an event indicator
NEAR = 1e-10  # of the duration: times this close coincide
TOUCH = 1e-9  # of the largest value of an indicator: one that turns this close to zero touches it
TIGHTER = 1e-3  # factor of the tolerance that the FMU receives, for its own decisions on events
FIXED_SHIFT = 1e-2  # of that change, for a parameter that can be set before the start only
FAR_BELOW = 1e-3  # share of a nominal value below which it is not the usual size of a state
RESET = 100.0  # in tolerances: smaller changes of the states at the start are errors of rounding


@dataclass
class VariedParameter:
    """A parameter: its variable, its value, and how it is changed.

    Attributes
    ----------
    variable
        Its variable.
    state : int
        Index of the state whose start value it is, or -1.
    input : int
        Index of the driven input whose factor it is, or -1.
    value : float
        Its value, which is 1 for a factor.
    side : int or None
        Whether the FMU takes both neighbouring values (0), or only larger (1) or smaller (-1) ones; None if it takes
        none, or cannot be changed after the start.
    """

    variable: Any
    state: int
    input: int
    value: float = 1.0
    side: int | None = None

    @property
    def is_set(self) -> bool:
        """Return whether it is changed by setting its variable."""
        return self.state < 0 and self.input < 0

    @property
    def kind(self) -> int:
        """Return whether its variable is set, and can be set at an event."""
        if not self.is_set:
            return NOT_SET
        is_tunable = self.variable.variability == "tunable" or self.variable.causality == "input"
        return TUNABLE if is_tunable else FIXED

    @property
    def shift(self) -> float:
        """Return the largest change for differences of an event indicator."""
        return SHIFT * abs(self.value) or SHIFT


def has_capability(folder: Path, *names: str, interface_name: str = "ModelExchange") -> bool:
    """Return whether an unpacked FMU has a capability for an interface, by its names in FMI 2.0 and 3.0."""
    interface = etree.parse(str(folder / DESCRIPTION_FILE)).getroot().find(interface_name)  # fmpy reads FMI 2.0 only
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
    max_steps : int
        Number of steps after which a run fails.
    """

    def __init__(
        self,
        instance: FmuInstance,
        folder: Path,
        spec: RunSpec,
        parameters: Sequence[str],
        max_steps: int = MAX_STEPS,
    ) -> None:
        assert spec.start is not None
        assert spec.stop is not None
        self.instance, self.fmu, self.spec, self.parameters = instance, instance.fmu, spec, tuple(parameters)
        self.max_steps = max_steps
        self.start, self.stop, self.library = spec.start, spec.stop, load_library()
        self.tolerance = NEAR * (self.stop - self.start)
        description, variables = instance.description, instance.variables
        self.can_save = has_capability(folder, "canGetAndSetFMUstate", "canGetAndSetFMUState")
        states = state_variables(description)
        rates = [unknown.variable for unknown in description.derivatives]
        self.inputs = [variables[name] for name in spec.inputs if name != TIME]
        self.columns = {name: np.asarray(column, dtype=float) for name, column in spec.inputs.items()}
        self.settings = {variables[name]: value for name, value in spec.values.items()}
        self.states = states
        self.varied_parameters = [
            VariedParameter(item, *(group.index(item) if item in group else -1 for group in (states, self.inputs)))
            for item in map(variables.__getitem__, parameters)
        ]
        calculated_names = {unknown.variable.name for unknown in description.initialUnknowns}
        self.calculated_states = [i for i, state in enumerate(states) if state.name in calculated_names]
        self.modes = tuple(read_model_data(spec.fmu).contacts.values())
        self.update = self.fmu.newDiscreteStates if instance.is_fmi2 else self.fmu.updateDiscreteStates
        self.n, self.m, self.q = len(states), len(parameters), int(description.numberOfEventIndicators or 0)
        self.usual_sizes = np.full(self.n, inf)
        self.allocate({"states": states, "rates": rates, "inputs": self.inputs})

    def allocate(self, groups: dict[str, list[Any]]) -> None:
        """Allocate the buffers of the loop."""
        from scipy.integrate import DOP853

        instance, n, m, q, is_fmi2 = self.instance, self.n, self.m, self.q, self.instance.is_fmi2
        size, rates = max(n * (1 + m), 1), groups["rates"]
        self.times = np.asarray(self.spec.times, dtype=float)
        self.arrays: dict[str, np.ndarray] = {
            "k": np.zeros((EXTENDED_STAGES, size)),
            "dense": np.zeros((DENSE, size)),
            "nominals": np.ones(max(n, 1)),
            "positions": np.array([rates.index(item) if item in rates else -1 for item in groups["states"]], np.int64),
            "samples": np.zeros((SAMPLES, max(q, 1))),
            "work": np.zeros(len(self.inputs) + 2 * n + 3),
            "times": self.times,
            "values": np.full((len(self.times), 1 + m, len(self.spec.outputs)), nan),
            "table": np.zeros((2, 1 + len(self.inputs))),
        }
        self.arrays |= {name: np.zeros(size) for name in ("z", "z1", "largest", "touch")}
        self.arrays |= {name: np.zeros(max(q, 1)) for name in ("g", "g1", "largest_g", "t_far", "g_far")}
        self.arrays |= {name: np.ascontiguousarray(getattr(DOP853, key)) for name, key in TABLEAU.items()}
        self.allocate_logs()
        groups["modes"] = [instance.variables[name] for name in self.modes]
        groups["outputs"] = [instance.variables[name] for name in self.spec.outputs]
        outputs = [unknown.variable for unknown in instance.description.outputs]
        groups["influenced"] = [*groups["rates"], *(output for output in outputs if output.type in REAL_TYPES)]
        self.references = {name: instance.make_references(group) for name, group in groups.items()}
        self.structs = (ParameterStruct * max(m, 1))(
            *(
                ParameterStruct(
                    parameter.variable.valueReference, parameter.state >= 0, parameter.input, kind=parameter.kind
                )
                for parameter in self.varied_parameters
            )
        )
        self.change_values({})
        sizes = {"n": n, "m": m, "q": q, "r": len(self.spec.outputs), "duration": self.stop - self.start}
        sizes |= {f"n_{name}": len(groups[name]) for name in ("inputs", "modes", "influenced")}
        sizes |= {"n_times": len(self.times), "n_signals": len(self.columns.get(TIME, ()))}
        run = self.run = RunStruct(instance=instance.component, fmi=2 if is_fmi2 else 3, **sizes)
        completes = (
            not instance.interface.completedIntegratorStepNotNeeded
            if is_fmi2
            else instance.interface.needsCompletedIntegratorStep
        )
        absent = (() if self.can_save else ("save", "restore", "release")) + (() if completes else ("complete",))
        for field, names in FUNCTIONS.items():
            if field not in absent:
                setattr(run, field, cast(instance.function(names[0 if is_fmi2 else -1]), c_void_p))
        for field, references in {**self.references, "parameters": self.structs}.items():
            setattr(run, field, cast(references, c_void_p))
        for field, array in self.arrays.items():
            setattr(run, field, array.ctypes.data)
        if set(groups["outputs"]) <= set(self.states):
            self.output_states = (c_uint32 * len(groups["outputs"]))(*map(self.states.index, groups["outputs"]))
            run.output_states = cast(self.output_states, c_void_p)
        run.rtol, run.graze, run.tolerance = self.spec.rtol, TOUCH, self.tolerance
        run.capacity, run.capacity_notes = len(self.arrays["event_values"]), len(self.arrays["note_values"])
        self.y = self.arrays["z"][:n]
        self.slopes = self.arrays["z"][n : n * (1 + m)].reshape(m, n)  # of the states, by parameter

    def change_values(self, values: Mapping[str, float]) -> None:
        """Give variables other values in the following runs, by name."""
        self.settings |= {self.instance.variables[name]: value for name, value in values.items()}
        for struct, parameter in zip(self.structs, self.varied_parameters, strict=False):
            if parameter.input < 0:
                parameter.value = float(self.settings.get(parameter.variable, parameter.variable.start or 0.0))
            struct.value = parameter.value

    def allocate_logs(self) -> None:
        """Allocate the logs of events and of times without derivatives, and the table of inputs."""
        m, notes = self.m, LOG_SIZE + 3 * (self.q + self.m)
        split_shape = (LOG_SIZE, 2, 1 + m, len(self.spec.outputs))
        signals = (
            [self.columns[name] for name in (TIME, *(variable.name for variable in self.inputs))] if self.inputs else []
        )
        self.arrays |= {
            "event_values": np.zeros((LOG_SIZE, 1 + m)),
            "event_codes": np.zeros((LOG_SIZE, 1 + 2 * len(self.modes)), dtype=np.int64),
            "note_values": np.zeros((notes, 1 + m)),
            "note_codes": np.zeros((notes, 2), dtype=np.int64),
            "split_values": np.zeros(split_shape),
            "signals": np.ascontiguousarray(np.transpose(signals)) if signals else np.zeros((1, 1)),
        }

    # ---- calls of the FMU

    def read(self, name: str, count: int) -> np.ndarray:
        """Return values (count,) that a method of the FMU writes into an array."""
        values = (c_double * count)()
        if count:
            getattr(self.fmu, name)(values, count)
        return np.array(values)

    def start_slopes(self, parameter: VariedParameter) -> np.ndarray:
        """Return the derivatives (n,) of the states at the start, in initialization mode."""
        slopes = np.zeros(self.n)
        if parameter.state >= 0:
            slopes[parameter.state] = 1.0
        elif parameter.is_set and self.calculated_states:
            unknowns = [self.states[i].valueReference for i in self.calculated_states]
            reference = parameter.variable.valueReference
            slopes[self.calculated_states] = self.fmu.getDirectionalDerivative(unknowns, [reference], [1.0])
        return slopes

    def failure(self, reason: str) -> HarnessError:
        """Return the error of a run that failed, with the message of the FMU if there is one."""
        return HarnessError(self.instance.log.error_message or f"{self.spec.fmu.name}: {reason}")

    def initialize(self, parameter: VariedParameter | None = None, change: float = 0.0) -> None:
        """Enter the initialization of the instance, with another value of one parameter."""
        settings = self.settings | ({parameter.variable: parameter.value + change} if parameter else {})
        self.instance.restart()
        stop = self.stop + 2.0 * self.tolerance
        self.instance.enter_initialization(settings.items(), self.start, stop, TIGHTER * self.spec.rtol)
        self.run.row = self.library.set_table(byref(self.run), c_double(self.start))

    # ---- the run

    def start_indicators(self, parameter: VariedParameter | None = None, change: float = 0.0) -> np.ndarray | None:
        """Return the event indicators (q,) at the start of a run with a changed parameter; None if the FMU refuses."""
        if parameter:
            low, high = find_bound(parameter.variable, "min"), find_bound(parameter.variable, "max")
            value = parameter.value + change
            if (low is not None and value < low) or (high is not None and value > high):
                return None
        try:
            self.initialize(parameter, change)
            self.fmu.exitInitializationMode()
            update_discrete_states(self.update, self.start)
            self.fmu.enterContinuousTimeMode()
        except CALL_FAILURES:
            if parameter is None:
                raise
            return None
        return self.read("getEventIndicators", self.q)

    def find_side(self, parameter: VariedParameter) -> int | None:
        """Return which neighbouring values of a parameter the FMU takes, as `VariedParameter.side`."""
        sides = [side for side in (1, -1) if self.start_indicators(parameter, side * parameter.shift) is not None]
        return 0 if len(sides) == 2 else sides[0] if sides else None

    def starts_otherwise(self, parameter: VariedParameter, base: np.ndarray) -> bool:
        """Return whether neighbouring start values lead to other modes, so that an indicator (q,) jumps."""
        for side in (1.0, -1.0):
            near, nearer = (self.start_indicators(parameter, side * h * parameter.shift) for h in (1.0, 1.0 / 16.0))
            if near is not None and nearer is not None:
                jump = np.abs(nearer - base)
                if np.any((jump > 0.5 * np.abs(near - base)) & (jump > 1e-6 * np.abs(base))):
                    return True
        return False

    def save_starts(self, parameter: VariedParameter, struct: ParameterStruct) -> None:
        """Save runs that have started with neighbouring values of a parameter that can be set before the start only."""
        if parameter.kind != FIXED or parameter.side is None or not self.can_save:
            return
        struct.change = (parameter.side or 1) * FIXED_SHIFT * parameter.shift
        for i, share in enumerate((0.0, 0.5, 1.0) if parameter.side else (0.0, 0.5, 1.0, -0.5, -1.0)):
            if self.start_indicators(parameter, share * struct.change) is not None:
                struct.starts[i] = self.fmu.getFMUState()

    def free_starts(self) -> None:
        """Free the saved runs."""
        for struct in self.structs:
            for i, state in enumerate(struct.starts):
                if state:
                    self.fmu.freeFMUState(c_void_p(state))
                    struct.starts[i] = None

    def begin(self) -> None:
        """Initialize the instance and the derivatives of its states."""
        base = self.start_indicators()
        assert base is not None
        for parameter in self.varied_parameters if self.q else ():
            if parameter.is_set and parameter.side is None:  # of runs with other values, only the first one looks
                parameter.side = self.find_side(parameter)
        for struct, parameter in zip(self.structs, self.varied_parameters, strict=False):
            struct.side = NO_SIDE if parameter.side is None else parameter.side
            self.save_starts(parameter, struct)
        self.initialize()
        for i, parameter in enumerate(self.varied_parameters):
            self.slopes[i] = self.start_slopes(parameter)
        start_parameters = [
            parameter
            for parameter, slopes in zip(self.varied_parameters, self.slopes, strict=True)
            if self.q and slopes.any()
        ]
        if start_parameters:
            jumps = [
                parameter
                for parameter in start_parameters
                if parameter.input < 0 and self.starts_otherwise(parameter, base)
            ]
            self.initialize()
        self.fmu.exitInitializationMode()
        before = self.read("getContinuousStates", self.n)
        self.run.next_event = update_discrete_states(self.update, self.start)
        self.fmu.enterContinuousTimeMode()
        self.y[:] = self.read("getContinuousStates", self.n)
        nominals = self.read("getNominalsOfContinuousStates", self.n)
        self.arrays["nominals"][: self.n] = np.minimum(nominals, self.usual_sizes)
        run = self.run
        run.t, run.h, run.next, run.n_steps, run.n_rhs = self.start, 1e-3 * (self.stop - self.start), 0, 0, 0
        run.is_fresh, run.last_t, run.n_at_once = False, self.start, 0
        run.n_events = run.n_notes = run.n_splits = 0
        self.arrays["largest"][:] = np.abs(self.arrays["z"])
        self.arrays["largest_g"][:] = 0.0
        self.events: list[EventDerivative] = []
        self.undefined_derivatives: list[UndefinedDerivative] = []
        self.sides = np.zeros(self.m)  # 0: derivatives exist; 1 or -1: for an increase or a decrease alone; NaN: none
        self.side_rows: list[tuple[int, np.ndarray]] = []  # number of rows before the sides changed
        self.one_sided: list[tuple[int, np.ndarray, np.ndarray]] = []  # row, derivatives from the left and right
        if np.any(np.abs(self.y - before) > RESET * self.spec.rtol * np.abs(before)):
            self.undefine(self.start, -1, "the states change at the start", np.full(self.m, nan))
        others = np.array(
            [nan if start_parameters and parameter in jumps else 0.0 for parameter in self.varied_parameters]
        )
        self.undefine(self.start, -1, "nearby values start in another mode", others)
        zeros = np.zeros(self.m)
        self.check(self.library.check_ties(byref(run), c_int64(-1), c_void_p(zeros.ctypes.data), c_double(0.0)))

    def solve(self, report: Callable[[float], object] = lambda share: None) -> VariationalSolution:
        """Integrate from start to stop.

        Raises
        ------
        HarnessError
            If the FMU fails, or its equations cannot be integrated or differentiated.
        """
        while True:
            failure = None
            try:
                self.begin()
                self.integrate(report)
            except HarnessError as error:
                failure = error
            finally:
                self.free_starts()
            if not self.lower_usual_sizes():
                break
        if failure:
            raise failure
        return self.make_solution()

    def lower_usual_sizes(self) -> bool:
        """Lower the usual sizes of states that stay far below their nominal values; return whether there are any.

        States of one unit have one size, so that the rounding errors of one that hardly moves are not followed.
        """
        largest, nominals = (self.arrays[name][: self.n] for name in ("largest", "nominals"))
        units, is_lowered = np.array([variable_unit(state) for state in self.states]), False
        for unit in np.unique(units):
            group = units == unit
            size = largest[group].max()
            if 0.0 < size < FAR_BELOW * nominals[group].max():
                self.usual_sizes[group], is_lowered = size, True
        return is_lowered

    def integrate(self, report: Callable[[float], object]) -> None:
        """Integrate to the stop, through all events."""
        run, end, status = self.run, self.stop + self.tolerance, LOG_FULL  # an event at the stop is found
        while status != REACHED:
            check_interrupt()
            report(min(1.0, (run.t - self.start) / (self.stop - self.start)))
            run.max_steps = min(run.n_steps + STEPS_PER_CHECK, self.max_steps)
            status = self.library.solve(byref(run), c_double(end))
            self.read_logs()
            if status != LOG_FULL and not (status == TOO_MANY_STEPS and run.n_steps < self.max_steps):
                self.check(status)

    def check(self, status: int) -> None:
        """Raise the error of a call of the loop that failed."""
        if status == REACHED:
            return
        run, at = self.run, f"at t = {self.run.t:.9g} s"
        if status == NO_NEIGHBOUR:
            parameter = self.varied_parameters[run.indicator]
            raise self.failure(f"it takes no value next to {parameter.variable.name} = {parameter.value!r}")
        raise self.failure(
            {
                STEP_EVENT: f"it has an event {at} that no event indicator locates",
                TERMINATED: f"it ends the simulation {at}",
                FAILED: f"its equations, or their derivatives, have no finite values {at}",
                TOO_MANY_STEPS: f"it needs more than {self.max_steps} steps, {at}: "
                "choose an earlier stop or a larger rtol",
                EVENT_TERMINATED: f"it returned terminateSimulation from an event {at}",
                EARLY_EVENT: f"it sets its next event to {run.next_event:.9g} s, {at}",
                UNSETTLED: f"its discrete states do not settle {at}",
                NO_SAVED_STATE: f"its states jump {at}, and it cannot save its state",
                NO_VALUE: f"an event indicator has no finite values {at}",
                NO_END: f"{MAX_EVENTS} events {at}",
            }[status]
        )

    def read_logs(self) -> None:
        """Read and empty the logs of events, and of times without derivatives."""
        run, logs, count, n_splits = self.run, self.arrays, len(self.modes), 0
        for values, codes in zip(logs["event_values"][: run.n_events], logs["event_codes"].tolist(), strict=False):
            before, after = tuple(codes[1 : 1 + count]), tuple(codes[1 + count :])
            self.events.append(EventDerivative(float(values[0]), codes[0], before, after, values[1:].copy()))
        for values, codes in zip(logs["note_values"][: run.n_notes].copy(), logs["note_codes"].tolist(), strict=False):
            indicator, reason = codes
            if reason == RECORDED:
                self.split_row(int(values[0]), values[1:], indicator, *logs["split_values"][n_splits])
                n_splits += 1
            else:
                self.undefine(float(values[0]), indicator, REASONS[reason], values[1:])
        run.n_events = run.n_notes = run.n_splits = 0

    def undefine(self, t: float, indicator: int, reason: str, sides: np.ndarray) -> None:
        """Note that derivatives do not exist from a time in s on (0: they do; 1, -1: for one side; NaN: for none)."""
        if not (is_concerned := (sides != 0.0) & ~np.isnan(self.sides)).any():
            return
        names = tuple(name for name, is_affected in zip(self.parameters, is_concerned, strict=True) if is_affected)
        self.undefined_derivatives.append(UndefinedDerivative(t, indicator, reason, names))
        agree = (self.sides == 0.0) | (self.sides == sides)
        self.sides = np.where(is_concerned, np.where(agree, sides, nan), self.sides)
        self.side_rows.append((int(np.searchsorted(self.times, t - self.tolerance)), self.sides))

    def split_row(self, row: int, slopes: np.ndarray, indicator: int, early: np.ndarray, late: np.ndarray) -> None:
        """Note the one-sided derivatives at a recorded time at which an event happens.

        `early` and `late` (1 + parameters, outputs) are the outputs and their derivatives before and after the event.
        """
        jumps = np.abs(late[0] - early[0]) > self.spec.rtol * np.abs(early[0])
        is_delayed = (slopes > 0.0)[:, None]  # by an increase of the parameter
        after = np.where(jumps & (slopes != 0.0)[:, None], nan, late[1:])
        sides = np.where(is_delayed, after, early[1:]), np.where(is_delayed, early[1:], after)
        self.one_sided.append((row, *sides))
        if (is_concerned := (sides[0] != sides[1]).any(axis=1)).any():
            names = tuple(np.array(self.parameters)[is_concerned].tolist())
            self.undefined_derivatives.append(
                UndefinedDerivative(float(self.times[row]), indicator, "an event happens then", names, True)
            )

    def make_solution(self) -> VariationalSolution:
        """Return the solution up to the stop."""
        rows = self.arrays["values"]
        left, right = rows[:, 1:].copy(), rows[:, 1:].copy()
        for begin, sides in self.side_rows:
            left[begin:, (sides == 1.0) | np.isnan(sides)] = nan
            right[begin:, (sides == -1.0) | np.isnan(sides)] = nan
        for index, before, after in self.one_sided:
            left[index], right[index] = before, after
        is_used = np.asarray(rows[:, 1:].any(axis=(0, 2)) | self.slopes.any(axis=1))
        for event in self.events:
            is_used |= event.slopes != 0.0
        for item in self.undefined_derivatives:
            is_used |= np.isin(self.parameters, item.parameters)
        counts = int(self.run.n_steps), int(self.run.n_rhs)
        return VariationalSolution(
            rows[:, 0].copy(), left, right, is_used, (*self.events,), (*self.undefined_derivatives,), *counts
        )


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
    description = read_leniently(folder)
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
