"""Lowers the runtime from vectors to scalars for one model; the results are embedded in the FMU or translated to C.

    layout.py              facts fixed by model and features; names of vector components: y2_x, y2_v of y2
    feature_selection.py   the integration methods and friction laws that an FMU includes
    vector_symbols.py      attributes, results and constants found in the sources
    scalarize.py           expressions and statements of a function, component by component
    elimination.py         the linear systems of rodas and radau9
    constant_folding.py    replaces flags, choices and dependent tests by constants
    module_lowering.py     a file, statement by statement
    lowered_modules.py     lowers all files of the runtime and the model, and removes what nothing calls
    import_hook.py         imports the lowered model into this process

An annotation such as `e: StateVector` of a parameter, result or class attribute declares a vector; results of vector
operations are vectors.  Components are named after the states and modes of the model: y2_x and y2_v of y2, modes0_mode
of modes0, J_v_x of a Jacobian J.  f = model.rates(t, y, modes) has all rates: the generated method computes those that
are no states, and the others are copies of y.

A ConditionVector is stored in a list, as in margins[:] = model.condition_margins(t, y, modes).

A loop over contact_indices, state_indices or velocity_indices is unrolled; a function with a parameter
`i: ContactIndex` is written once for each contact.  A loop over the methods is unrolled for the methods that the FMU
offers; a loop that tests each of them becomes a chain of conditions.
Tests check that the vectors as lists, scalars and C give the same bits (tests/lowering/test_lowering.py).
"""

from .feature_selection import LAWS, METHODS, select_features
from .import_hook import (
    function_tree,
    lowered_files,
    lowered_model,
    model_exchange_run,
    sibling_module,
)
from .layout import component_name

__all__ = [
    "LAWS",
    "METHODS",
    "component_name",
    "function_tree",
    "lowered_files",
    "lowered_model",
    "model_exchange_run",
    "select_features",
    "sibling_module",
]
