"""What the FMI layer asks: translated like the numerics, and called in fmi2.c as rules_step and so on."""

from typing import Any

from .kinds import BOOL, FLOAT, Kind, Object


def entries(rules: Any, model: Object) -> dict[Any, list[Kind]]:
    """Every function of the rules, as written out, with what it takes; one that others call stands before them."""
    run = Object(rules.Run)
    return {
        rules.within: [FLOAT] * 5,
        rules.reason: [run, BOOL, BOOL, BOOL],
        rules.change: [run, model],
        rules.setup: [run, FLOAT, FLOAT, FLOAT],
        rules.begin: [run, model],
        rules.step: [run, model, FLOAT, FLOAT],
        rules.observe: [run, model],
        rules.report: [model, BOOL],
        rules.is_sound: [run, model, BOOL],
    }
