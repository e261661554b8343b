"""What the FMI layer asks: translated like the numerics, and called in C as rules_step and so on."""

from typing import Any

from ...runtime.declare import Declaring
from ..written import beside
from .kinds import BOOL, FLOAT, Kind, Object

ASKED = {  # file of the runtime -> its functions; one that others call stands before them
    "rules": ("within", "reason", "change", "setup", "begin", "step", "observe", "report", "is_sound"),
    "exchange": (
        *("take_over", "nominals", "begin", "ready", "move_to", "put", "states", "rates", "input_rates"),
        *("indicators", "show", "handle"),
    ),
    "leaps": ("aim", "leap", "handle"),  # for FMI 3.0
}
FLAGS = ("calculated", "fixed", "allowed", "exchanges", "ahead", "waits")  # of their parameters those that are bools


def entries(model: type[Declaring], run: Object, led: Object, fmi: str) -> dict[Any, list[Kind]]:
    """All these functions, as written out for a model, with what they take: the names of their parameters tell it."""
    kinds: dict[str, Kind] = {"run": run, "model": led, **dict.fromkeys(FLAGS, BOOL)}
    found = {}
    for file in [file for file in ASKED if file != "leaps" or fmi == "3"]:
        functions = beside(model, f"runtime.{file}")
        for name in ASKED[file]:
            code = getattr(functions, name).__code__
            taken = code.co_varnames[: code.co_argcount]
            found[getattr(functions, name)] = [kinds.get(parameter, FLOAT) for parameter in taken]
    return found
