"""The variables that no model declares: the time, event indicators, the rate of a driver; and what becomes of states.

They stand behind the declared variables, whose value references stay.
"""

from typing import Any

from ..runtime.variable_declarations import Local, VariableDeclaration, VariableOwner, variables
from .lowering import sibling_module

TIME, TO_REST, TO_BREAK_AWAY = "time", "events.to_rest", "events.to_break_away"
DERIVATIVE_NAME = "der({})"  # of a state that a driver is
Variables = list[tuple[str, VariableDeclaration]]


class TimeVariable(VariableDeclaration):
    """The independent variable."""

    causality, variability = "independent", "continuous"


class ContinuousLocal(Local):
    """Calculated; continuous between events."""

    variability = "continuous"


def model_exchange_instance(model: type[VariableOwner]) -> Any:
    """An object of a model, as written out, that an importer's solver may lead."""
    exchange = sibling_module(model, "runtime.model_exchange")
    thing = type(model.__name__, (exchange.ModelExchangeMixin, model), {})()
    exchange.update_nominals(thing)
    return thing


def attribute_path(name: str) -> str:
    """Where a variable is in such an object."""
    if name == TIME:
        return "solver.t"
    if name.startswith((TO_REST, TO_BREAK_AWAY)):
        return name.replace("events", "model_exchange", 1)
    return "model_exchange.driver_rate" if name.startswith(DERIVATIVE_NAME[:4]) else name


def integrated_states(declared: Variables) -> Variables:
    """The states that a solver integrates, in order."""
    return [(name, meaning) for name, meaning in declared if meaning.role == "state" and not meaning.rate]


def all_variables(thing: Any) -> Variables:
    """Name and declaration of every variable of such an object: those declared, then the others, the time last."""
    declared = variables(thing)
    meanings = dict(declared)
    found: Variables = []
    forces = [meaning.unit for _, meaning in declared if meaning.role == "contact"]
    states = [meaning for _, meaning in integrated_states(declared)]
    speed = next((meaning.unit for meaning in states if meaning.rate_of), states[0].unit)
    for (mode, slip), force in zip(thing.contacts.items(), forces, strict=True):
        tail, where = (f"_{mode}", f" of {mode}") if len(forces) > 1 else ("", "")
        rest = f"event indicator{where}: speed in the direction of the slide; 1 while stuck"
        away = f"event indicator{where}: holding limit less load on the body at rest; 1 while sliding"
        found += [
            (TO_REST + tail, ContinuousLocal(meanings[slip].unit if slip else speed, rest)),
            (TO_BREAK_AWAY + tail, ContinuousLocal(force, away)),
        ]
    for name, meaning in declared:
        if meaning.rate:
            words = "rate of the " + meaning.text.split(",")[0]
            found.append((DERIVATIVE_NAME.format(name), ContinuousLocal(meanings[meaning.rate].unit, words)))
    return [*declared, *found, (TIME, TimeVariable("s", "the independent variable"))]


def derivative_indices(declared: Variables) -> dict[int, int]:
    """The places of the derivatives, each with that of its state: states as declared, then drivers."""
    names = {name: index for index, (name, _) in enumerate(declared)}
    rates = {names[name]: names[meaning.rate_of] for name, meaning in declared if meaning.rate_of}
    of_state = {state: rate for rate, state in rates.items() if declared[state][1].role == "state"}
    drivers = {names[DERIVATIVE_NAME.format(name)]: names[name] for name, meaning in declared if meaning.rate}
    return {of_state[names[name]]: names[name] for name, _ in integrated_states(declared)} | drivers


def event_indicator_indices(declared: Variables) -> list[int]:
    """The places of the event indicators: all to rest before all to break away."""
    return [
        index
        for start in (TO_REST, TO_BREAK_AWAY)
        for index, (name, _) in enumerate(declared)
        if name.startswith(start)
    ]
