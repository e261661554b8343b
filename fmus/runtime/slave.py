"""The FMI 2.0 side: a pythonfmu slave made from a declared model."""

from __future__ import annotations

from math import inf, nan
from typing import Any

from pythonfmu.fmi2slave import Fmi2Slave, Fmi2Status

from . import rules
from .boundary import guarded
from .declare import Declaring
from .hosted import Hosted, hosting
from .values import getter, setter


def slave_for(model: type[Declaring]) -> Any:
    """The slave of a model class, under its name."""
    return hosting(Slave, model)


class Slave(Hosted, Fmi2Slave):
    """One instance of a model as pythonfmu's native layer calls it."""

    @guarded
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        try:
            stop_time, tolerance = inf if stop_time is None else stop_time, tolerance or 0.0
            rules.setup(self.run, start_time, stop_time, tolerance)
        except BaseException as error:  # as in hosted.py
            self.rescue(error)

    # No variable is a Boolean or a String; a host that asks all the same is told so, and not crashed.

    get_real, set_real = getter("Real", nan), setter("Real")
    get_integer, set_integer = getter("Integer", 0), setter("Integer")
    get_boolean, set_boolean = getter("Boolean", False), setter("Boolean")
    get_string, set_string = getter("String", ""), setter("String")

    def log(self, msg: object, status: int = Fmi2Status.ok, category: str | None = None, debug: Any = None) -> None:
        """The native layer takes the message for a printf format."""
        super().log(str(msg).replace("%", "%%"), Fmi2Status(status), category, debug)
