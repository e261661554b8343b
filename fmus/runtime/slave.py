"""FMI 2.0 co-simulation slave of pythonfmu for a model."""

from __future__ import annotations

from math import inf, nan
from typing import Any

from pythonfmu.fmi2slave import Fmi2Slave, Fmi2Status

from . import call_sequence
from .model_instance import ModelInstance, make_fmu_class
from .pythonfmu_workarounds import signal_safe
from .variable_access import make_getter, make_setter
from .variable_declarations import VariableOwner


def make_slave_class(model: type[VariableOwner]) -> Any:
    """Make the slave class of a model class, with the same name."""
    return make_fmu_class(Slave, model)


class Slave(ModelInstance, Fmi2Slave):
    """Instance of a model with the methods that the native layer of pythonfmu calls."""

    @signal_safe
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        try:
            stop_time, tolerance = inf if stop_time is None else stop_time, tolerance or 0.0
            call_sequence.set_experiment(self.run, start_time, stop_time, tolerance)
        except BaseException as error:  # as in model_instance.py
            self.handle_exception(error)

    # No variable is a Boolean or a String; these methods report an error instead of crashing the host.

    get_real, set_real = make_getter("Real", nan), make_setter("Real")
    get_integer, set_integer = make_getter("Integer", 0), make_setter("Integer")
    get_boolean, set_boolean = make_getter("Boolean", False), make_setter("Boolean")
    get_string, set_string = make_getter("String", ""), make_setter("String")

    def log(self, msg: object, status: int = Fmi2Status.ok, category: str | None = None, debug: Any = None) -> None:
        """Log a message; percent signs are escaped, since the native layer uses it as a printf format."""
        super().log(str(msg).replace("%", "%%"), Fmi2Status(status), category, debug)
