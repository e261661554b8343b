"""What the page knows of a model: its variables, and what moves, read from its declaration and never from its name."""

import re
from inspect import cleandoc
from math import isfinite
from typing import Any

from ...runtime.variable_declarations import VariableDeclaration, VariableOwner
from ..description import declared_by
from ..equations.algebra import depends, derivative, leaves, same
from ..equations.anatomy import Anatomy
from ..equations.authored import Authored
from ..equations.declared import Contact, Fixed, Output, Parameter, State
from ..equations.expressions import Operand
from ..page import block, readable, typeset
from ..units import unit_of

FORCES = ("N", "N.m")
Portrait = dict[str, Any]  # as it stands in the page, in JSON


def portrait(source: Authored, model: type[VariableOwner]) -> Portrait:
    """The model of an author's file, as it is written out: words, default run, variables and bodies."""
    title, *blocks = cleandoc(model.__doc__ or "").split("\n\n")
    return {
        "name": source.name,
        "title": title,
        "text": "\n".join(map(block, blocks)),
        "stop": float(model.stop_time),  # type: ignore[attr-defined]
        "tolerance": float(model.tolerance),  # type: ignore[attr-defined]
        "variables": [variable(name, meaning) for name, meaning in declared_by(model)],
        "bodies": bodies(source.anatomy),
    }


def variable(name: str, meaning: VariableDeclaration) -> Portrait:
    """A declared variable; its value in the unit `shown` is `factor` times that in SI."""
    unit = unit_of(name, meaning.unit or "1")
    shown = {
        "name": name,
        "symbol": typeset(re.sub(r"(?<=[a-z])0$", "_0", name)),
        "type": meaning.type,
        "causality": meaning.causality,
        "text": meaning.text,
        "unit": meaning.unit,
        "shown": readable(meaning.display or meaning.unit),
        "factor": unit.factor if meaning.display else 1.0,
        "powers": [unit.kg, unit.m, unit.s, unit.rad],
        "start": meaning.start,
        "fixed": meaning.variability == "fixed",
        "allowed": readable(meaning.allowed),
        "items": [{"label": label, "value": value, "text": text} for label, value, text in meaning.items],
    }
    bounds = {"low": meaning.low, "high": meaning.high, "above": meaning.above, "below": meaning.below}
    return shown | {word: bound for word, bound in bounds.items() if isfinite(bound)}


def bodies(anatomy: Anatomy) -> list[Portrait]:
    """Whatever has a position, and what acts on it; a model without any shows its first state and its rate."""
    found = [body(anatomy, x) for x in anatomy.positions]
    x = anatomy.states[0]
    return found or [{"kind": "none", "position": x.name, "speed": anatomy.rate[x].name}]


def body(anatomy: Anatomy, x: State) -> Portrait:
    """One of them: `kind` is block, pendulum or rotor; the rest are names of variables, where there are any."""
    v = anatomy.rate[x]
    a = next((e for s, e in anatomy.rate.items() if s is v), None)
    law: Operand = a.means if isinstance(a, Output) else 0.0
    restoring, damping = derivative(law, {x: 1.0}), derivative(law, {v: 1.0})
    turns, bends = x.unit == "rad", depends(restoring, (x,))
    frictions = [c for c in anatomy.contacts if depends(c.slip, (v,))] or [e for e in anatomy.outputs if rubs(e, v)]
    linked = [y.name for y in anatomy.positions if y is not x and depends(law, (y,))]
    drives = [d for d in anatomy.drives if depends(law, (d,))]
    found = {
        "kind": "pendulum" if turns and bends else "rotor" if turns else "block",
        "position": x.name,
        "speed": v.name,
        "acceleration": a.name if a is not None else "",
        "driver": next((d.name for d in drives), ""),
        "driver_speed": next((d.steady.name for d in drives), ""),
        "linked": linked,
        "spring": not bends and not same(restoring, 0.0) and bool(drives or not linked),
        "dampers": [] if depends(damping, (v,)) else parameters(damping),
        "friction": next((e.name for e in frictions), ""),
        "mode": next((c.mode.name for c in frictions if isinstance(c, Contact)), ""),
        "start": x.begins.name if isinstance(x.begins, Fixed) else "",
        "input": next((e.name for e in anatomy.inputs if depends(law, (e,))), ""),
    }
    return {word: value for word, value in found.items() if value}


def parameters(e: Operand) -> list[str]:
    """The parameters in an expression that are no mass or inertia: any of them at zero makes it zero."""
    return [leaf.name for leaf in leaves(e) if isinstance(leaf, Parameter) and leaf.unit not in ("kg", "kg.m2", "m")]


def rubs(e: Output, v: State | Output) -> bool:
    """Whether an output is a force that hangs on the speed, and not in proportion."""
    return e.unit in FORCES and depends(derivative(e, {v: 1.0}), (v,))
