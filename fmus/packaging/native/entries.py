"""What the FMI layer asks: translated like the numerics, and called in C as rules_step and so on."""

from typing import Any

from .kinds import BOOL, FLOAT, Kind, Object


def entries(rules: Any, exchange: Any, leaps: Any, model: Object, fmi: str) -> dict[Any, list[Kind]]:
    """Every function of the rules, of model exchange and, for FMI 3.0, of steps in leaps, as written out, with what it
    takes; one that others call stands before them."""
    run = Object(rules.Run)
    found: dict[Any, list[Kind]] = {
        rules.within: [FLOAT] * 5,
        rules.reason: [run, BOOL, BOOL, BOOL],
        rules.change: [run, model],
        rules.setup: [run, FLOAT, FLOAT, FLOAT],
        rules.begin: [run, model],
        rules.step: [run, model, FLOAT, FLOAT],
        rules.observe: [run, model],
        rules.report: [model, BOOL],
        rules.is_sound: [run, model, BOOL],
        exchange.take_over: [run],
        exchange.nominals: [model],
        exchange.begin: [model],
        exchange.ready: [run, model],
        exchange.move_to: [run, model, FLOAT],
        exchange.put: [run, model],
        exchange.states: [model],
        exchange.rates: [model],
        exchange.input_rates: [model],
        exchange.indicators: [model],
        exchange.show: [model],
        exchange.handle: [run, model],
    }
    if fmi == "3":
        found |= {leaps.aim: [run, model, FLOAT, FLOAT], leaps.leap: [run, model, BOOL], leaps.handle: [run, model]}
    return found
