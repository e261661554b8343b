"""Model exchange with fmpy's CVode: BDF with finite-difference Jacobians.

The absolute tolerance is the relative one times the nominal values of the FMU. Where static friction does not exceed
sliding friction, CVode misses reversals that only touch v = 0.
"""

import os
from collections.abc import Callable
from math import inf
from typing import Any

from fmpy.simulation import Input
from fmpy.sundials import CVodeSolver

from ..errors import HarnessError
from .event_mode import MAX_EVENTS, Clocks, update_discrete_states
from .fmu_instance import FmuInstance, TerminatedError
from .stepping import InputSignals, TimeGrid

MAX_CVODE_STEPS = 100_000  # between two points
LOG_FILES = ("SUNLOGGER_ERROR_FILENAME", "SUNLOGGER_WARNING_FILENAME")  # environment variables of CVode


class CheckedCVode(CVodeSolver):
    """CVode that counts right-hand sides, reports each of them as progress, and stops at a failed FMI call."""

    error: BaseException | None = None
    n_rhs = 0

    def __init__(self, report_work: Callable[[], Any], **options: Any) -> None:
        self.report_work, self.max_steps = report_work, options["maxNumSteps"]
        before = dict(os.environ)
        os.environ.update(dict.fromkeys(LOG_FILES, os.devnull) | before)  # fmpy raises the messages of CVode
        try:
            super().__init__(**options)
        finally:
            for name in {*LOG_FILES} - {*before}:
                del os.environ[name]

    def f(self, t: float, *arguments: Any) -> int:
        self.n_rhs += 1
        return self.call_checked(self.set_inputs_and_rates, t, *arguments)

    def set_inputs_and_rates(self, t: float, *arguments: Any) -> int:
        """Set the inputs, which fmpy sets at the ends of its steps only, and compute the rates."""
        self.input.apply(t)
        return int(super().f(t, *arguments))

    def g(self, *arguments: Any) -> int:
        return self.call_checked(super().g, *arguments)

    def call_checked(self, call: Callable[..., int], *arguments: Any) -> int:
        """Call the FMU and keep its exception, which ctypes would print and swallow."""
        try:
            self.report_work()
            return call(*arguments)
        except BaseException as error:  # an interrupt, too
            self.error = error
            return -1

    def step(self, t: float, target: float) -> tuple[bool, Any, float]:
        """Integrate from t to the target or to the next event; times in s."""
        try:
            return super().step(t, target)
        except (RuntimeError, TypeError) as error:  # the path of CVode's source precedes its message
            limit = f"fmpy's CVode ({self.max_steps} steps from point to point at most)"
            raise self.error or HarnessError(f"{limit}: {str(error).rpartition(': ')[2]}") from None


class ModelExchange:
    """Steps an instance for model exchange to the next communication point or event.

    Parameters
    ----------
    instance : FmuInstance
        Instance for model exchange.
    grid : TimeGrid
        Communication points.
    rtol : float
        Relative tolerance.
    report_work : callable
        Called at every evaluation.
    signals : InputSignals, optional
        Input signals.
    max_steps : int
        Largest number of solver steps from point to point.
    clocks : Clocks, optional
        Clocks of an instance of FMI 3.0.
    """

    def __init__(
        self,
        instance: FmuInstance,
        grid: TimeGrid,
        rtol: float,
        report_work: Callable[[], Any],
        signals: InputSignals | None = None,
        max_steps: int = MAX_CVODE_STEPS,
        clocks: Clocks | None = None,
    ) -> None:
        self.instance, self.fmu, self.grid, self.signals, self.clocks = instance, instance.fmu, grid, signals, clocks
        self.rtol, self.report_work, self.max_steps = rtol, report_work, max_steps
        self.is_event, self.n_stalled = False, 0

    def start(self, t: float) -> None:
        if self.signals:
            self.signals.apply(t, after_event=True)
        fmu, description = self.fmu, self.instance.description
        self.update = fmu.newDiscreteStates if self.instance.is_fmi2 else fmu.updateDiscreteStates
        self.next_event = self.update_states(t)
        fmu.enterContinuousTimeMode()
        self.solver = CheckedCVode(
            self.report_work,
            nx=description.numberOfContinuousStates,
            nz=description.numberOfEventIndicators,
            get_x=fmu.getContinuousStates,
            set_x=fmu.setContinuousStates,
            get_dx=fmu.getDerivatives if self.instance.is_fmi2 else fmu.getContinuousStateDerivatives,
            get_z=fmu.getEventIndicators,
            get_nominals=fmu.getNominalsOfContinuousStates,
            set_time=fmu.setTime,
            input=self.signals or Input(fmu, description, None),
            startTime=t,
            maxStep=(self.grid.stop - self.grid.start) / 50,
            relativeTolerance=self.rtol,
            maxNumSteps=self.max_steps,
        )

    def advance(self, t: float, target: float) -> float:
        jump = self.signals.next_jump(t) if self.signals else inf
        target = min(target, self.next_event, jump)
        if self.clocks:
            target = self.clocks.limit(target)
        has_root, _, t_end = self.solver.step(t, target)
        t_end = target if abs(t_end - target) <= self.grid.tolerance else t_end
        self.fmu.setTime(t_end)
        if self.signals:
            self.signals.apply(t_end)
        needs_event = is_terminated = False
        if self.instance.interface.needsCompletedIntegratorStep:
            needs_event, is_terminated = self.fmu.completedIntegratorStep()
        if is_terminated:
            raise TerminatedError(t_end, "it returned terminateSimulation from a completed step")
        is_tick = self.clocks is not None and self.clocks.is_due(t_end)
        self.is_event = has_root or needs_event or is_tick or t_end >= min(self.next_event, jump)
        self.n_stalled = 0 if t_end > t else self.n_stalled + 1
        if self.n_stalled > MAX_EVENTS:
            raise HarnessError(f"{MAX_EVENTS} events in a row at t = {t_end:.9g} s")
        return t_end

    def handle_event(self, t: float) -> None:
        self.fmu.enterEventMode()
        if self.signals:
            self.signals.apply(t, after_event=True)
        self.next_event = self.update_states(t)
        self.fmu.enterContinuousTimeMode()
        self.solver.reset(t)

    def update_states(self, t: float) -> float:
        """Tick the clocks and iterate the discrete states; return the time of the next event in s."""
        return self.clocks.handle_event(t, self.update) if self.clocks else update_discrete_states(self.update, t)
