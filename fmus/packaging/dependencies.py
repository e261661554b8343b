"""What every output follows from at the start, found by trying: one value is changed, and who follows is seen.

A dependency may show in few situations only, as that on what holds a body that is about to break away.  So many are
tried: zeros, both signs, all sizes, every choice, and loads about as large as friction can hold, or just so large.
"""

from collections.abc import Sequence
from math import isfinite
from random import Random
from types import SimpleNamespace
from typing import Any

from ..runtime.declare import Declared, Declaring
from ..runtime.values import SETTABLE
from .equations.authored import first_states
from .written import beside

SITUATIONS = 2000
SIZES = 2.0  # powers of ten above and below a start value
LOADS = (-1.5, -1.0, -0.5, 0.5, 1.0, 1.5)  # of a body at rest, in holding limits
TRIES = 100  # to meet a range


def at_start(model: type[Declaring], declared: list[tuple[str, Declared]]) -> dict[str, list[str]]:
    """For every output the parameters and inputs that it follows from while the model is initialised.

    The settings of the solver are chosen like all others but not tried: at the start it has not stepped yet.
    """
    thing: Any = model()
    outputs = [name for name, meaning in declared if meaning.causality == "output"]
    known = {name: meaning for name, meaning in declared if meaning.causality in SETTABLE}
    if not outputs:
        return {}
    entry = next((name for name, meaning in known.items() if meaning.causality == "input"), "")
    sizes: dict[str, list[float]] = {}  # values of a unit meet at the size of one of them
    for meaning in known.values():
        sizes.setdefault(meaning.unit, []).append(abs(meaning.start) or 1.0)
    found: dict[str, set[str]] = {name: set() for name in outputs}
    chance = Random(0)
    for _ in range(SITUATIONS):
        values = {name: another(meaning, sizes, chance) for name, meaning in known.items()}
        put(thing, values)
        if thing.dry and entry and begun(thing, outputs):
            load, limit = at_rest(thing, chance)
            values[entry] += one(LOADS, chance) * limit - load
            put(thing, values)
        before = begun(thing, outputs)
        for name in (name for name in known if "." not in name and before):
            put(thing, {name: another(known[name], sizes, chance)})
            for output, old, new in zip(outputs, before, begun(thing, outputs), strict=False):
                if new != old:
                    found[output].add(name)
            put(thing, {name: values[name]})
    return {output: [name for name in known if name in found[output]] for output in outputs}


def at_rest(thing: Any, chance: Random) -> tuple[float, float]:
    """The load on a contact at the start, if all are stuck, and its limit."""
    if not thing.coupled:
        load, _, limit = thing.hold(0.0, *first_states(thing))
        return load, limit
    many = len(thing.contacts)
    found = thing.forces(0.0, *first_states(thing), *(0 for _ in range(many)))
    return one(list(zip(found[:many], found[many : 2 * many], strict=True)), chance)


def another(meaning: Declared, sizes: dict[str, list[float]], chance: Random) -> float:
    """A value that is allowed; the start value where the range is narrow."""
    if meaning.items:
        return one(meaning.items, chance)[1]
    for _ in range(TRIES):
        size = one(sizes[meaning.unit], chance) * 10.0 ** (SIZES * (2.0 * chance.random() - 1.0))
        value = one((0.0, size, -size), chance)
        if meaning.accepts(value):
            return value
    return meaning.start


def one(things: Sequence[Any], chance: Random) -> Any:
    """One of several; what Random itself chooses may be another in another Python."""
    return things[int(chance.random() * len(things))]


def put(thing: Any, values: dict[str, float]) -> None:
    """Set variables by their dotted names."""
    for name, value in values.items():
        owner, *path = thing, *name.split(".")
        for part in path[:-1]:
            owner = getattr(owner, part)
        setattr(owner, path[-1], value)


def begun(thing: Any, outputs: list[str]) -> list[float]:
    """The outputs at the start; none where the values do not go together, or lead out of the range of numbers."""
    try:
        if thing.prepare():
            return []
        thing.solver.start(thing, 0.0, *first_states(thing), thing.stop_time, thing.tolerance)
        beside(type(thing), "runtime.rules").show(SimpleNamespace(), thing)
    except (ArithmeticError, ValueError):
        return []
    values = [getattr(thing, output) for output in outputs]
    return values if all(map(isfinite, values)) else []
