"""What the FMI layer asks: translated like the numerics, and called in C as call_sequence_do_step and so on."""

from typing import Any

from ...runtime.variable_declarations import VariableOwner
from ..lowering import sibling_module
from .kinds import BOOL, FLOAT, Kind, Object

ASKED = {  # file of the runtime -> its functions; one that others call stands before them
    "call_sequence": (
        *("is_in_range", "rejection_reason", "note_change", "set_experiment", "exit_initialization", "do_step"),
        *("update_outputs", "update_statistics", "is_valid_state"),
    ),
    "model_exchange": (
        *("enable", "update_nominals", "begin", "prepare", "set_time", "set_continuous_states", "update_states"),
        *("update_rates", "update_input_rates", "update_indicators", "update_variables", "handle_event"),
    ),
    "early_return": ("begin_step", "next_internal_step", "complete_event"),  # for FMI 3.0
}
FLAGS = (
    "calculated",
    "fixed",
    "allowed",
    "exchanges",
    "ahead",
    "defer_events",
)  # of their parameters those that are bools


def entries(model: type[VariableOwner], run: Object, led: Object, fmi: str) -> dict[Any, list[Kind]]:
    """All these functions, as written out for a model, with what they take: the names of their parameters tell it."""
    kinds: dict[str, Kind] = {"run": run, "model": led, **dict.fromkeys(FLAGS, BOOL)}
    found = {}
    for file in [file for file in ASKED if file != "early_return" or fmi == "3"]:
        functions = sibling_module(model, f"runtime.{file}")
        for name in ASKED[file]:
            code = getattr(functions, name).__code__
            taken = code.co_varnames[: code.co_argcount]
            found[getattr(functions, name)] = [kinds.get(parameter, FLOAT) for parameter in taken]
    return found
