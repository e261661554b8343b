"""The FMI 3.0 side: co-simulation and model exchange in one, as the native layer calls it.

The native layer does not tell what an instance was made for, nor start, stop and tolerance, nor the mode of the FMI
state machine.  So an instance is undecided until a step is asked for (co-simulation) or a time, a state or an event
comes (model exchange), and the run begins where the first step does.
"""

from __future__ import annotations

from math import nan
from typing import Any

from . import exchange, rules
from .boundary import guarded
from .codes import CO_SIMULATION, DIVERGED, MODEL_EXCHANGE, OK, RUNNING, UNDECIDED
from .declare import Declaring
from .failure import ERROR
from .hosted import Hosted, hosting
from .step import HUGE
from .values import getter, setter
from .variables3 import further, place
from .vectors import magnitude, total


def slave_for(model: type[Declaring]) -> Any:
    """The slave of a model class, under its name."""
    made = hosting(Slave, type(model.__name__, (exchange.Exchanging, model), {}))
    made.variables = made.variables + further(model, made.variables)
    return made


class Message:
    """What the native layer reads of one."""

    def __init__(self, status: int, category: str, msg: str) -> None:
        self.status, self.category, self.msg, self.debug = status, category, msg, False


class Stepped:
    """What it reads after a communication step."""

    def __init__(self, status: int) -> None:
        self.status, self.terminateSimulation = status, False


class Updated:
    """What it reads after an event: by these names."""

    discreteStatesNeedUpdate = nextEventTimeDefined = False
    nextEventTime = 0.0

    def __init__(self, terminate: bool = False, states: bool = False, nominals: bool = False) -> None:
        self.terminateSimulation = terminate
        self.valuesOfContinuousStatesChanged, self.nominalContinuousStatesChanged = states, nominals


class Blank:
    """What it reads for an unsigned number; no variable is one."""

    value = 0


STEPPED, NOT_STEPPED = Stepped(0), Stepped(ERROR)


class Instance:
    """What the native layer asks of every instance."""

    def __init__(self, instance_name: str = "", resources: str = "", logger: object = 0, visible: bool = False) -> None:
        self.instance_name = instance_name
        self.messages: list[Message] = []

    def log(self, sentence: str, status: int) -> None:
        self.messages.append(Message(status, "logStatusError", sentence))

    def _get_log_queue(self) -> list[Message]:
        return self.messages

    def enter_initialization_mode(self) -> None:
        """Nothing arrives here, neither tolerance nor start nor stop time."""

    def terminate(self) -> None:
        """Nothing is open."""


def asker(function: Any, number: Any) -> Any:
    """The method that tells what `function` makes of the present point; NaN where there is nothing to compute with."""

    @guarded
    def ask(slave: Slave) -> Any:
        try:
            if number(slave) and slave.ready():
                return function(slave.model, slave.model.solver)
        except (ArithmeticError, ValueError):
            pass  # a state that the importer's solver only tries may be anything
        except BaseException as error:  # as in hosted.py
            slave.rescue(error)
        return [nan] * number(slave)

    return ask


class Slave(Hosted, Instance):
    """One instance of a model, for co-simulation or for model exchange."""

    exchanges = True

    def begin(self, **kwargs: Any) -> None:
        super().begin(**kwargs)
        self.run.interface = UNDECIDED
        self.nominals = exchange.nominals(self.model)

    get_float64, set_float64 = getter("Real", nan), setter("Real")
    get_int32 = get_int64 = getter("Integer", 0)
    set_int32 = set_int64 = setter("Integer")

    # No variable is of these types; a host that asks all the same is told so, and not crashed.

    get_uint64, set_uint64 = getter("Boolean", Blank), setter("Boolean")
    get_boolean, set_boolean = getter("Boolean", False), setter("Boolean")
    get_string, set_string = getter("String", ""), setter("String")

    def place(self, name: str) -> str:
        return place(name)

    def report(self, ahead: bool) -> None:
        super().report(ahead)
        self.model.exchange.show(self.model, self.model.solver)

    # ---- co-simulation

    @guarded
    def do_step(self, current_time: float, step_size: float) -> Stepped:
        try:
            run, model = self.run, self.model
            status = OK if run.interface == CO_SIMULATION else rules.begin_steps(run, model, current_time)
            if status != OK:
                self.give_up(status, current_time)
                return NOT_STEPPED
            return STEPPED if Hosted.do_step(self, current_time, step_size) else NOT_STEPPED
        except BaseException as error:  # as in hosted.py
            self.rescue(error)
            return NOT_STEPPED

    # ---- model exchange

    def get_number_of_continuous_states(self) -> int:
        march = self.model.solver
        return len(march.y) + 1 if self.model.driven else len(march.y)

    def get_number_of_event_indicators(self) -> int:
        return 2 * len(self.model.solver.modes)

    @guarded
    def set_time(self, t: float) -> None:
        try:
            self.begin_exchange()
            exchange.move_to(self.model, self.model.solver, t)
        except BaseException as error:  # as above
            self.rescue(error)

    @guarded
    def set_continuous_states(self, states: list[float]) -> None:
        try:
            self.begin_exchange()
            exchange.put(self.model, self.model.solver, states)
        except BaseException as error:  # as above
            self.rescue(error)

    def get_nominals_of_continuous_states(self, number: int) -> Any:
        return exchange.nominals(self.model)[:number]

    get_continuous_states = asker(exchange.states, get_number_of_continuous_states)
    get_continuous_state_derivatives = asker(exchange.rates, get_number_of_continuous_states)
    get_event_indicators = asker(exchange.indicators, get_number_of_event_indicators)

    @guarded
    def update_discrete_states(self) -> Updated:
        try:
            self.begin_exchange()
            model, march = self.model, self.model.solver
            if self.ready():
                if total(magnitude(march.y)) < HUGE:
                    before, self.nominals = self.nominals, exchange.nominals(model)
                    return Updated(states=exchange.update(model, march), nominals=self.nominals != before)
                self.give_up(DIVERGED)
        except BaseException as error:  # as above
            self.rescue(error)
        return Updated(terminate=True)

    def begin_exchange(self) -> None:
        """From here on the importer's solver steps."""
        run = self.run
        run.observed = False
        if run.interface != MODEL_EXCHANGE:
            run.interface = MODEL_EXCHANGE
            exchange.begin(self.model.solver)

    def ready(self) -> bool:
        """Whether the values can be used; a run that has begun fails if they cannot."""
        run = self.run
        if run.phase < RUNNING:
            if not run.observed:
                self.observe()
            return run.observed
        try:
            status = rules.ready(run, self.model)
            return status == OK or self.give_up(status)
        except BaseException as error:  # as above
            return self.rescue(error)

    def observe(self) -> None:
        try:
            super().observe()
        except (ArithmeticError, ValueError):
            if self.run.interface != MODEL_EXCHANGE:
                raise
            self.silence()
