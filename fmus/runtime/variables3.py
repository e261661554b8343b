"""The variables of FMI 3.0 that no model declares: time, event indicators, rate of the driver."""

from __future__ import annotations

from typing import Any

from .declare import Declared, Local

TIME, TO_REST, TO_BREAK_AWAY = "time", "events.to_rest", "events.to_break_away"
DERIVATIVE = "der({})"  # of a state that a driver is
PLACES = {TIME: "solver.t", TO_REST: "exchange.to_rest", TO_BREAK_AWAY: "exchange.to_break_away"}


def place(name: str) -> str:
    """Where a variable is in a model that owns an Exchange."""
    return "exchange.driver" if name.startswith(DERIVATIVE[:4]) else PLACES.get(name, name)


class Time(Declared):
    """The independent variable."""

    causality, variability = "independent", "continuous"


class Smooth(Local):
    """Calculated; continuous between events."""

    variability = "continuous"


def further(model: Any, declared: list[tuple[str, Declared]]) -> list[tuple[str, Declared]]:
    """Name and declaration of those that go with a model, whose declared variables are given likewise."""
    units = {name: meaning.unit for name, meaning in declared}
    found: list[tuple[str, Declared]] = [(TIME, Time("s", "the independent variable"))]
    if model.dry:
        (speed,) = [meaning.unit for _, meaning in declared if meaning.role == "state" and meaning.rate_of]
        (force,) = [meaning.unit for _, meaning in declared if meaning.role == "contact"]
        rest = "event indicator: speed in the direction of the slide; 1 while stuck"
        away = "event indicator: holding limit less load on the body at rest; 1 while sliding"
        found += [(TO_REST, Smooth(speed, rest)), (TO_BREAK_AWAY, Smooth(force, away))]
    for name, meaning in declared:
        if meaning.rate:
            words = "rate of the " + meaning.text.split(",")[0]
            found.append((DERIVATIVE.format(name), Smooth(units[meaning.rate], words)))
    return found
