"""What the page knows of a model: its variables, and what moves, read from its declaration and never from its name."""

import re
from inspect import cleandoc
from math import isfinite
from typing import Any

from ...runtime.variable_declarations import VariableDeclaration, VariableOwner
from ..documentation_page import format_paragraph, readable_unit, typeset
from ..equations.algebra import depends_on, differentiate, is_same_expression, variables_in
from ..equations.expressions import Operand
from ..equations.model_analysis import ModelAnalysis
from ..equations.model_declaration import Contact, Fixed, Output, Parameter, State
from ..equations.model_file import ModelFile
from ..model_description import declared_variables
from ..units import unit_of

FORCES = ("N", "N.m")
ModelJson = dict[str, Any]  # as it stands in the page, in JSON


def build_model_json(source: ModelFile, model: type[VariableOwner]) -> ModelJson:
    """The model of an author's file, as it is written out: words, default run, variables and bodies."""
    title, *blocks = cleandoc(model.__doc__ or "").split("\n\n")
    return {
        "name": source.name,
        "title": title,
        "text": "\n".join(map(format_paragraph, blocks)),
        "stop": float(model.stop_time),  # type: ignore[attr-defined]
        "tolerance": float(model.tolerance),  # type: ignore[attr-defined]
        "variables": [variable_json(name, meaning) for name, meaning in declared_variables(model)],
        "bodies": list_bodies(source.analysis),
    }


def variable_json(name: str, meaning: VariableDeclaration) -> ModelJson:
    """A declared variable; its value in the unit `shown` is `factor` times that in SI."""
    unit = unit_of(name, meaning.unit or "1")
    shown = {
        "name": name,
        "symbol": typeset(re.sub(r"(?<=[a-z])0$", "_0", name)),
        "type": meaning.type,
        "causality": meaning.causality,
        "text": meaning.text,
        "unit": meaning.unit,
        "shown": readable_unit(meaning.display or meaning.unit),
        "factor": unit.factor if meaning.display else 1.0,
        "powers": [unit.kg, unit.m, unit.s, unit.rad],
        "start": meaning.start,
        "fixed": meaning.variability == "fixed",
        "allowed": readable_unit(meaning.allowed),
        "items": [{"label": label, "value": value, "text": text} for label, value, text in meaning.items],
    }
    bounds = {"low": meaning.low, "high": meaning.high, "above": meaning.above, "below": meaning.below}
    return shown | {word: bound for word, bound in bounds.items() if isfinite(bound)}


def list_bodies(analysis: ModelAnalysis) -> list[ModelJson]:
    """Whatever has a position, and what acts on it; a model without any shows its first state and its rate."""
    found = [body_json(analysis, x) for x in analysis.positions]
    x = analysis.states[0]
    return found or [{"kind": "none", "position": x.name, "speed": analysis.rate[x].name}]


def body_json(analysis: ModelAnalysis, x: State) -> ModelJson:
    """One of them: `kind` is block, pendulum or rotor; the rest are names of variables, where there are any."""
    v = analysis.rate[x]
    a = next((e for s, e in analysis.rate.items() if s is v), None)
    law: Operand = a.expression if isinstance(a, Output) else 0.0
    restoring, damping = differentiate(law, {x: 1.0}), differentiate(law, {v: 1.0})
    turns, bends = x.unit == "rad", depends_on(restoring, (x,))
    frictions = [c for c in analysis.contacts if depends_on(c.slip, (v,))] or [
        e for e in analysis.outputs if is_friction_force(e, v)
    ]
    linked = [y.name for y in analysis.positions if y is not x and depends_on(law, (y,))]
    drives = [d for d in analysis.drivers if depends_on(law, (d,))]
    found = {
        "kind": "pendulum" if turns and bends else "rotor" if turns else "block",
        "position": x.name,
        "speed": v.name,
        "acceleration": a.name if a is not None else "",
        "driver": next((d.name for d in drives), ""),
        "driver_speed": next((d.constant_rate.name for d in drives), ""),
        "linked": linked,
        "spring": not bends and not is_same_expression(restoring, 0.0) and bool(drives or not linked),
        "dampers": [] if depends_on(damping, (v,)) else scaling_parameters(damping),
        "friction": next((e.name for e in frictions), ""),
        "mode": next((c.mode.name for c in frictions if isinstance(c, Contact)), ""),
        "start": x.start_expression.name if isinstance(x.start_expression, Fixed) else "",
        "input": next((e.name for e in analysis.inputs if depends_on(law, (e,))), ""),
    }
    return {word: value for word, value in found.items() if value}


def scaling_parameters(e: Operand) -> list[str]:
    """The parameters in an expression that are no mass or inertia: any of them at zero makes it zero."""
    return [
        leaf.name for leaf in variables_in(e) if isinstance(leaf, Parameter) and leaf.unit not in ("kg", "kg.m2", "m")
    ]


def is_friction_force(e: Output, v: State | Output) -> bool:
    """Whether an output is a force that hangs on the speed, and not in proportion."""
    return e.unit in FORCES and depends_on(differentiate(e, {v: 1.0}), (v,))
