"""What the FMI layer asks: translated like the numerics, and called in fmi2.c as rules_step and so on."""

from typing import Any

from ...runtime import rules
from .kinds import BOOL, FLOAT, Kind, Object

RUN = Object(rules.Run)


def entries(model: Object) -> dict[Any, list[Kind]]:
    """Every function with what it takes; one that others call stands before them."""
    return {
        rules.within: [FLOAT] * 5,
        rules.reason: [RUN, BOOL, BOOL, BOOL],
        rules.change: [RUN, model],
        rules.setup: [RUN, FLOAT, FLOAT, FLOAT],
        rules.begin: [RUN, model],
        rules.step: [RUN, model, FLOAT, FLOAT],
        rules.observe: [RUN, model],
        rules.report: [model, BOOL],
        rules.is_sound: [RUN, model, BOOL],
    }
