"""The variables of FMI 3.0 beside the declared ones: time, event indicators, rate of the driver."""

from .declare import Declared, Local

TIME, TO_REST, TO_BREAK_AWAY, TO_DRIVER = "time", "events.to_rest", "events.to_break_away", "der(x_driver)"
PLACES = {  # in a model that owns an Exchange
    TIME: "solver.t",
    TO_REST: "exchange.to_rest",
    TO_BREAK_AWAY: "exchange.to_break_away",
    TO_DRIVER: "exchange.driver",
}


class Time(Declared):
    """The independent variable."""

    causality, variability = "independent", "continuous"


class Smooth(Local):
    """Calculated; continuous between events."""

    variability = "continuous"


def beside(model, declared):
    """Name and declaration of those that a model has, whose declared variables are given likewise."""
    _, speed, *_ = (meaning for _, meaning in declared if meaning.causality == "output")
    push = next(meaning for _, meaning in declared if meaning.causality == "input")
    found = [(TIME, Time("s", "the independent variable"))]
    if model.dry:
        rest = "event indicator: speed in the direction of the slide; 1 while stuck"
        away = "event indicator: holding limit less load on the body at rest; 1 while sliding"
        found += [(TO_REST, Smooth(speed.unit, rest)), (TO_BREAK_AWAY, Smooth(push.unit, away))]
    if model.driven:
        found.append((TO_DRIVER, Smooth(speed.unit, "rate of the position of the driver")))
    return found
