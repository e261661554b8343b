"""What the FMI layer asks: translated like the numerics, and called in C as call_sequence_do_step and so on."""

from typing import Any

from ...runtime.variable_declarations import VariableOwner
from ..lowering import sibling_module
from .c_types import BOOL, FLOAT, CType, StructPointer

ENTRY_POINTS = {  # file of the runtime -> its functions; one that others call stands before them
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
BOOL_PARAMETERS = (
    "calculated",
    "fixed",
    "allowed",
    "exchanges",
    "ahead",
    "defer_events",
)  # of their parameters those that are bools


def entry_point_types(
    model: type[VariableOwner], run: StructPointer, led: StructPointer, fmi: str
) -> dict[Any, list[CType]]:
    """All these functions, as written out for a model, with what they take: the names of their parameters tell it."""
    arg_types: dict[str, CType] = {"run": run, "model": led, **dict.fromkeys(BOOL_PARAMETERS, BOOL)}
    found = {}
    for file in [file for file in ENTRY_POINTS if file != "early_return" or fmi == "3"]:
        functions = sibling_module(model, f"runtime.{file}")
        for name in ENTRY_POINTS[file]:
            code = getattr(functions, name).__code__
            taken = code.co_varnames[: code.co_argcount]
            found[getattr(functions, name)] = [arg_types.get(parameter, FLOAT) for parameter in taken]
    return found
