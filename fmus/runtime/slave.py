"""FMI 2.0 co-simulation slave of pythonfmu for a model; call_sequence.py decides which calls are valid.

No exception may reach the host: the native layer of pythonfmu would release references that it still needs, and a host
other than Python would abort.  Errors are reported in one message, in the log and on standard error; then do_step
returns False and every calculated Real reads NaN.  A refused step also returns False, but changes nothing.

The native layer can refuse a step only.  So an invalid value is remembered, and the next step is refused.  Every
calculated Real reads NaN until the value is corrected or a later step succeeds, because some hosts ignore a refused
step.  If the values are invalid when initialisation ends, the run fails.
"""

from __future__ import annotations

from math import inf, nan
from typing import Any
from weakref import WeakSet

from pythonfmu.fmi2slave import Fmi2Slave, Fmi2Status

from . import call_sequence
from .codes import BAD_STEP, BAD_VALUE, OK, RUNNING
from .pythonfmu_workarounds import signal_safe
from .run_state import RunState
from .saved_state import SavedStateAccess, attribute_tree
from .variable_access import make_getter, make_setter
from .variable_declarations import VariableOwner, fmi_variables


def make_slave_class(model: type[VariableOwner]) -> Any:
    """Make the slave class of a model class, with the same name.

    A temporary instance is inspected for the variables: CPython 3.11 reads attributes half as fast once __dict__ of an
    object has been accessed, so that of a running instance is never accessed.
    """
    instance = model()
    run = RunState(instance)
    attributes = {
        "Model": model,
        "variables": fmi_variables(instance, run),
        "model_tree": attribute_tree(instance),
        "run_tree": attribute_tree(run),
        "__module__": __name__,
    }
    attributes["instances"] = WeakSet()
    fmu_class: Any = type(model.__name__, (Slave,), attributes)
    fmu_class.plain_class = fmu_class  # entry scripts may derive a subclass
    return fmu_class


class Slave(SavedStateAccess, Fmi2Slave):
    """Instance of the model class `Model`, with the methods that the native layer of pythonfmu calls."""

    Model: type  # set by make_slave_class()

    @signal_safe
    def __init__(self, **kwargs: Any) -> None:
        try:
            self.initialize(**kwargs)
        except Exception:
            raise
        except BaseException as error:  # the native layer needs the new instance after a reset
            self.initialize(**kwargs)
            self.handle_exception(error)

    def initialize(self, **kwargs: Any) -> None:
        """Set the state after instantiation."""
        super().__init__(**kwargs)
        self.instances.add(self)
        self.model = self.Model()
        self.run = RunState(self.model)
        self.has_warned = False
        self.initialize_access()

    @signal_safe
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        try:
            stop_time, tolerance = inf if stop_time is None else stop_time, tolerance or 0.0
            call_sequence.set_experiment(self.run, start_time, stop_time, tolerance)
        except BaseException as error:  # an exception outside Python would crash the host
            self.handle_exception(error)

    @signal_safe
    def exit_initialization_mode(self) -> None:
        try:
            status = call_sequence.exit_initialization(self.run, self.model)
            if status != OK:
                self.fail_with_status(status)
        except BaseException as error:  # as above
            self.handle_exception(error)

    @signal_safe
    def do_step(self, current_time: float, step_size: float) -> Any:
        try:
            run, model = self.run, self.model
            outputs_were_read = run.outputs_current
            status = call_sequence.do_step(run, model, current_time, step_size)
            if status != OK:
                if status == BAD_VALUE and not any(self.invalid_values.values()):
                    status = self.step_without_invalid_values(current_time, step_size)
                if status != OK:
                    refuses = run.phase >= RUNNING and call_sequence.is_refusal(run, status)
                    report = self.refuse_step if refuses else self.fail_with_status
                    return report(status, current_time, step_size)
            if self.polynomials and model.inconsistent_input > 0:
                self.warn_of_inconsistent_rate()
            if outputs_were_read:  # the importer reads outputs at every step: computing them here saves calls
                call_sequence.set_outputs(run, model)
            return True
        except BaseException as error:  # as above
            return self.handle_exception(error)

    def step_without_invalid_values(self, t: float, h: float) -> Any:
        """Do a step of size h from t, without the invalid values for which a step was refused; return a status."""
        run, model = self.run, self.model
        if not call_sequence.communication_step_end(run, run.solver, t, h) >= run.solver.t:
            return BAD_STEP
        self.invalid_values.clear()
        run.n_invalid_values, run.outputs_current = 0, False
        return call_sequence.do_step(run, model, t, h)

    # No variable is a Boolean or a String; these methods report an error instead of crashing the host.

    get_real, set_real = make_getter("Real", nan), make_setter("Real")
    get_integer, set_integer = make_getter("Integer", 0), make_setter("Integer")
    get_boolean, set_boolean = make_getter("Boolean", False), make_setter("Boolean")
    get_string, set_string = make_getter("String", ""), make_setter("String")

    def log(self, msg: object, status: int = Fmi2Status.ok, category: str | None = None, debug: Any = None) -> None:
        """Log a message; percent signs are escaped, since the native layer uses it as a printf format."""
        super().log(str(msg).replace("%", "%%"), Fmi2Status(status), category, debug)
