"""FMI variables beyond those that a model declares: time, event indicators, rate of the driver.

They follow the declared variables, whose value references do not change.
"""

from copy import copy
from typing import Any

from ..runtime.run_state import RunState
from ..runtime.stick_slip import HYBRID_LAW
from ..runtime.variable_declarations import Local, VariableDeclaration, fmi_variables, variables

TIME, TO_REST, TO_BREAK_AWAY = "time", "events.to_rest", "events.to_break_away"
CONDITION = "events.condition_{}"  # indicator of a condition of the equations, numbered from 1
DERIVATIVE_NAME = "der({})"  # derivative of the position of a driver
Variables = list[tuple[str, VariableDeclaration]]


class TimeVariable(VariableDeclaration):
    """The independent variable."""

    causality, variability = "independent", "continuous"


class ContinuousLocal(Local):
    """A calculated local variable, continuous between events."""

    variability = "continuous"


def declared_variables(model: Any) -> Variables:
    """Return name and declaration of the variables of a model class and its solver; a mode names its contact."""
    instance = model()
    declarations = fmi_variables(instance, RunState(instance))
    force_of = {mode: force for force, mode in mode_names(model, declarations).items()}
    return [
        (name, name_contact(meaning, force_of[name]) if name in force_of else meaning) for name, meaning in declarations
    ]


def mode_names(model: Any, declarations: Variables) -> dict[str, str]:
    """Return the name of the mode of each contact, by that of its friction force."""
    forces = [name for name, meaning in declarations if meaning.role == "contact"]
    return dict(zip(forces, model.contacts, strict=True))


def name_contact(mode: VariableDeclaration, force: str) -> VariableDeclaration:
    """Return the declaration of a mode with the force of its contact in its text, where importers find it."""
    declaration = copy(mode)
    declaration.text = f"mode of {force}: {mode.text}"
    return declaration


def fixed_choices(model: Any) -> Variables:
    """Return name and declaration, with its one item, of each enumeration that the build fixed: it is no variable."""
    instance = model()
    declarations = variables(instance) + variables(RunState(instance))
    names = {name for name, _ in declared_variables(model)}
    choices = [(name, copy(meaning)) for name, meaning in declarations if meaning.items and name not in names]
    for _, meaning in choices:
        meaning.items = tuple(item for item in meaning.items if item[1] == meaning.start)
    return choices


def friction_laws(model: Any) -> list[str]:
    """Return the labels of the friction laws that the build includes, of a model that has a choice of them."""
    return [label for name, meaning in variables(model()) if name == "friction" for label, _, _ in meaning.items]


def has_step_events(model: Any) -> bool:
    """Return whether an importer must report its steps.

    Friction laws without stick and slip change modes there, and contacts in a plane note the direction of their slip.
    """
    return hasattr(model, "planar_modes") or any(law != HYBRID_LAW[0] for law in friction_laws(model))


def integrated_states(declarations: Variables) -> Variables:
    """Return the states that a solver integrates, in order of declaration."""
    return [(name, meaning) for name, meaning in declarations if meaning.role == "state" and not meaning.rate]


def all_variables(model: Any) -> Variables:
    """Return name and declaration of all variables: declared ones, those for model exchange, time."""
    declarations = declared_variables(model)
    meanings = dict(declarations)
    additional_variables: Variables = []
    forces = [meaning.unit for _, meaning in declarations if meaning.role == "contact"]
    states = [meaning for _, meaning in integrated_states(declarations)]
    speed = next((meaning.unit for meaning in states if meaning.rate_of), states[0].unit)
    for (mode, slip), force in zip(model.contacts.items(), forces, strict=True):
        tail, of_mode = (f"_{mode}", f" of {mode}") if len(forces) > 1 else ("", "")
        stick_text = f"event indicator{of_mode}: speed in the direction of sliding; 1 while stuck"
        slip_text = f"event indicator{of_mode}: holding limit minus load on the body at rest; 1 while sliding"
        unit = meanings[slip].unit if slip else speed
        if mode in getattr(model, "planar_modes", ()):
            unit, stick_text = "1", f"event indicator{of_mode}: slip, relative to that at the last event; 1 while stuck"
            slip_text = slip_text.replace("1 while sliding", "while sliding, the share of growth left")
        additional_variables += [
            (TO_REST + tail, ContinuousLocal(unit, stick_text)),
            (TO_BREAK_AWAY + tail, ContinuousLocal(force, slip_text)),
        ]
    for n in range(model.n_event_functions - model.first_condition):
        text = f"event indicator of condition {n + 1}; falls to zero where {model.condition_texts[n]}"
        additional_variables.append((CONDITION.format(n + 1), ContinuousLocal(model.condition_units[n], text)))
    for name, meaning in declarations:
        if meaning.rate:
            description = "rate of the " + meaning.text.split(",")[0]
            additional_variables.append(
                (DERIVATIVE_NAME.format(name), ContinuousLocal(meanings[meaning.rate].unit, description))
            )
    return [*declarations, *additional_variables, (TIME, TimeVariable("s", "the independent variable"))]


def interpolated_inputs(model: Any) -> list[str]:
    """Return the names of inputs whose derivative an importer of FMI 2.0 may set: those that have no declared rate."""
    instance = model()
    prescribed_names = [name for name, _ in instance.prescribed_inputs]
    inputs = [name for name, meaning in declared_variables(model) if meaning.causality == "input"]
    return [name for name in inputs if name not in prescribed_names and hasattr(instance, f"{name}_polynomial")]


def derivative_indices(declarations: Variables) -> dict[int, int]:
    """Return {index of derivative: index of its state}: states in order of declaration, then drivers."""
    names = {name: index for index, (name, _) in enumerate(declarations)}
    rates = {names[name]: names[meaning.rate_of] for name, meaning in declarations if meaning.rate_of}
    of_state = {state: rate for rate, state in rates.items() if declarations[state][1].role == "state"}
    drivers = {names[DERIVATIVE_NAME.format(name)]: names[name] for name, meaning in declarations if meaning.rate}
    return {of_state[names[name]]: names[name] for name, _ in integrated_states(declarations)} | drivers


def event_indicator_indices(declarations: Variables) -> list[int]:
    """Return the indices of the event indicators: coming to rest, breaking away, conditions."""
    return [
        index
        for start in (TO_REST, TO_BREAK_AWAY, CONDITION[:-2])
        for index, (name, _) in enumerate(declarations)
        if name.startswith(start)
    ]
