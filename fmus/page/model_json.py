"""Describes a model for the page, in JSON: variables and moving bodies, derived from the declaration of the model."""

import re
from inspect import cleandoc
from math import isfinite
from typing import Any

from ..compiler.equations.algebra import depends_on, differentiate, is_same_expression, variables_in
from ..compiler.equations.expressions import Operand
from ..compiler.equations.model_analysis import ModelAnalysis
from ..compiler.equations.model_declaration import Contact, Fixed, Output, Parameter, State
from ..compiler.equations.model_file import ModelFile
from ..compiler.units import BASE_UNITS, unit_of
from ..packaging.documentation_page import format_paragraph, readable_unit, table_figure, typeset
from ..packaging.fmi_variables import declared_variables
from ..runtime.variable_declarations import VariableDeclaration, VariableOwner, exported_name

FORCES = ("N", "N.m")
ModelJson = dict[str, Any]  # an object of the JSON data in the page


def build_model_json(source: ModelFile, model: type[VariableOwner]) -> ModelJson:
    """Describe a model: documentation, default experiment, variables and bodies."""
    title, *blocks = cleandoc(model.__doc__ or "").split("\n\n")
    return {
        "name": source.name,
        "title": title,
        "text": "\n".join((*map(format_paragraph, blocks), *map(table_figure, source.analysis.tables))),
        "stop": float(model.stop_time),  # type: ignore[attr-defined]
        "tolerance": float(model.tolerance),  # type: ignore[attr-defined]
        "variables": [variable_json(name, meaning) for name, meaning in declared_variables(model)],
        "contacts": [{"name": c.name, "mode": c.mode.name} for c in source.analysis.contacts],
        "bodies": list_bodies(source.analysis),
    }


def variable_json(name: str, meaning: VariableDeclaration) -> ModelJson:
    """Describe a variable. Its value in the unit `display_unit` is `factor` times its value in SI units."""
    unit = unit_of(name, meaning.unit or "1")
    description = {
        "name": exported_name(name, meaning),
        "symbol": typeset(re.sub(r"(?<=[a-z])0$", "_0", exported_name(name, meaning))),
        "type": meaning.type,
        "causality": meaning.causality,
        "text": meaning.text,
        "unit": meaning.unit,
        "display_unit": readable_unit(meaning.display or meaning.unit),
        "factor": unit.factor if meaning.display else 1.0,
        "unit_exponents": [getattr(unit, base) for base in BASE_UNITS],
        "start": meaning.start,
        "fixed": meaning.variability == "fixed",
        "allowed": readable_unit(meaning.allowed_range),
        "items": [{"label": label, "value": value, "text": text} for label, value, text in meaning.items],
    }
    bounds = {"low": meaning.low, "high": meaning.high, "above": meaning.above, "below": meaning.below}
    return description | {key: bound for key, bound in bounds.items() if isfinite(bound)}


def list_bodies(analysis: ModelAnalysis) -> list[ModelJson]:
    """Describe the bodies of a model, one per position; without any, the first state and its derivative."""
    bodies = [body_json(analysis, x) for x in analysis.positions]
    x = analysis.states[0]
    contacts = [c.name for c in analysis.contacts]
    return bodies or [{"kind": "none", "position": x.name, "speed": analysis.rate[x].name, "contacts": contacts}]


def body_json(analysis: ModelAnalysis, x: State) -> ModelJson:
    """Describe a body: `kind` is block, pendulum or rotor; the other items are names of variables."""
    v = analysis.rate[x]
    a = next((e for s, e in analysis.rate.items() if s is v), None)
    law: Operand = a.expression if isinstance(a, Output) else 0.0
    stiffness, damping = differentiate(law, {x: 1.0}), differentiate(law, {v: 1.0})
    is_angle, is_nonlinear = x.unit == "rad", depends_on(stiffness, (x,))
    frictions = [c for c in analysis.contacts if depends_on(c.slip, (v,))] or [
        e for e in analysis.outputs if is_friction_force(e, v)
    ]
    linked_positions = [y.name for y in analysis.positions if y is not x and depends_on(law, (y,))]
    drives = [d for d in analysis.drivers if pulls_on(law, d, x)]
    slip = v.name if frictions and slips_with(frictions[0], v) else ""
    items = {
        "kind": "pendulum" if is_angle and is_nonlinear else "rotor" if is_angle else "block",
        "position": x.name,
        "speed": v.name,
        "acceleration": a.name if a is not None else "",
        "driver": next((d.name for d in drives), ""),
        "driver_speed": next((d.constant_rate.name for d in drives), ""),
        "linked": linked_positions,
        "spring": not is_nonlinear and not is_same_expression(stiffness, 0.0) and bool(drives or not linked_positions),
        "dampers": [] if depends_on(damping, (v,)) else scaling_parameters(damping),
        "friction": next((e.name for e in frictions), ""),
        "slip": slip,
        "contacts": [c.name for c in frictions if isinstance(c, Contact)],
        "mode": next((c.mode.name for c in frictions if isinstance(c, Contact)), ""),
        "start": x.start_expression.name if isinstance(x.start_expression, Fixed) else "",
        "input": next((e.name for e in analysis.inputs if depends_on(law, (e,))), ""),
    }
    return {key: value for key, value in items.items() if value}


def scaling_parameters(e: Operand) -> list[str]:
    """Return the parameters in a damping coefficient, except masses, inertias and lengths: if one is zero, so is it."""
    return [
        leaf.name for leaf in variables_in(e) if isinstance(leaf, Parameter) and leaf.unit not in ("kg", "kg.m2", "m")
    ]


def slips_with(friction: Contact | Output, v: State | Output) -> bool:
    """Check whether the slip speed of a friction force is the speed v, so that the force can be drawn over v."""
    if isinstance(friction, Contact):
        return is_same_expression(friction.slip, v)
    return variables_of_motion(friction) == {v.name}


def moves_along(law: Operand, driver: State, x: State) -> bool:
    """Check whether an acceleration stays the same if the driver and the position x move by the same distance."""
    return is_same_expression(differentiate(law, {x: 1.0, driver: 1.0}), 0.0)


def pulls_on(law: Operand, driver: State, x: State) -> bool:
    """Check whether a driver pulls on x, unlike a phase angle, which enters an acceleration by its sine."""
    pull = differentiate(law, {driver: 1.0})
    return depends_on(law, (driver,)) and (moves_along(law, driver, x) or not depends_on(pull, (driver,)))


def variables_of_motion(e: Output) -> set[str]:
    """Return the names of the variables that an output depends on, except parameters."""
    return {leaf.name for leaf in variables_in(e.expression) if not isinstance(leaf, Parameter | Fixed)}


def is_friction_force(e: Output, v: State | Output) -> bool:
    """Check whether an output is a force or torque that depends nonlinearly on the speed."""
    return e.unit in FORCES and depends_on(differentiate(e, {v: 1.0}), (v,))
