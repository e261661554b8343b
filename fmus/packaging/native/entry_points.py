"""Entry points: the functions that the FMI layer calls, in C as call_sequence_do_step and so on."""

from typing import Any

from ...runtime.variable_declarations import VariableOwner
from ..lowering import sibling_module
from .c_types import BOOL, FLOAT, INT, CType, StructPointer

ENTRY_POINTS = {  # module of the runtime -> its functions; callees come before their callers
    "variable_declarations": ("is_in_range",),
    "call_sequence": (
        *("rejection_reason", "note_change", "set_experiment", "check_experiment", "is_refusal"),
        *("exit_initialization", "do_step", "update_outputs", "update_statistics", "is_valid_state"),
    ),
    "model_exchange": (
        *("enable", "update_nominals", "begin", "prepare", "set_time", "set_continuous_states", "update_states"),
        *("update_rates", "update_input_rates", "update_indicators", "update_variables", "has_step_event"),
        *("complete_step", "handle_event"),
    ),
    "early_return": ("begin_step", "next_internal_step", "complete_event"),  # for FMI 3.0
}
# Parameters of type bool; run and model are structs, a status is an int, all others are floats.
BOOL_PARAMETERS = ("calculated", "fixed", "allowed", "exchanges", "ahead", "defer_events")


def entry_point_types(
    model: type[VariableOwner], run: StructPointer, instance: StructPointer, fmi: str
) -> dict[Any, list[CType]]:
    """Return the entry points of a model with the types of their arguments, which follow from the parameter names."""
    known_types: dict[str, CType] = {"run": run, "model": instance, "status": INT}
    known_types |= dict.fromkeys(BOOL_PARAMETERS, BOOL)
    types = {}
    for file in [file for file in ENTRY_POINTS if file != "early_return" or fmi == "3"]:
        functions = sibling_module(model, f"runtime.{file}")
        for name in ENTRY_POINTS[file]:
            code = getattr(functions, name).__code__
            parameters = code.co_varnames[: code.co_argcount]
            types[getattr(functions, name)] = [known_types.get(parameter, FLOAT) for parameter in parameters]
    return types
