"""Lowers the runtime from vectors to scalars for one model; the results are embedded in the FMU or translated to C.

    layout.py              facts fixed by model and features; names of vector components: x2, v2 of y2
    feature_selection.py   the integration methods and friction laws that an FMU includes
    source_symbols.py      attributes, results and constants found in the sources
    scalarize.py           expressions and statements of a function, component by component
    elimination.py         the linear system of rodas
    constant_folding.py    replaces flags, choices and dependent tests by constants
    emit_source.py         a file, line by line: unchanged lines are copied with their comments
    symbol_table.py        what each name refers to: a function or class of a file, a member of a class
    dead_code.py           removes unused code
    lowered_sources.py     lowers all files of the runtime and the model
    import_hook.py         imports the lowered model into this process

An annotation such as `e: StateVector` of a parameter, result or class attribute declares a vector; results of vector
operations are vectors.  A RateVector holds the rates at the StateVector that is declared last before it; so does the
result of model.rates(t, y2, modes) at y2.  Those of its rates that are states are read from there.  A vector may have
any name, which only decides how its components are printed:

    y, y2, step.y0           named after the states: x, v;  x2, v2;  step.x0, step.v0
    f, f2, step.f0           named after the rates: a;  a2;  step.a0
    modes, step.modes0       named after the modes: mode;  step.mode0
    e, k3, self.c2           all others: e_x, e_v;  k3_x, k3_v;  self.c2_x, self.c2_v

A ConditionVector is stored in a list, as in margins[:] = model.condition_margins(t, y, modes).

A loop over contact_indices, state_indices or velocity_indices is unrolled; a function with a parameter
`i: ContactIndex` is written once for each contact.  A loop over the methods is unrolled for the methods that the FMU
offers; a loop that tests each of them becomes a chain of conditions.
Tests check that arrays, scalars and C give the same bits (tests/lowering/test_lowering.py).
"""

from .feature_selection import LAWS, METHODS, select_features
from .import_hook import (
    function_tree,
    lowered_files,
    lowered_model,
    model_exchange_run,
    scalar_name,
    sibling_module,
)
from .scalarize import LoweringError

__all__ = [
    "LAWS",
    "METHODS",
    "LoweringError",
    "function_tree",
    "lowered_files",
    "lowered_model",
    "model_exchange_run",
    "scalar_name",
    "select_features",
    "sibling_module",
]
