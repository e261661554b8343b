"""The numerics over vectors, written out in scalars for the model at hand: from them the FMU and the C are made.

    spec.py            what a model and an offer fix; the names of the numbers of a vector: x2, v2 of y2
    offer.py           which methods and friction laws there are, and which an FMU offers
    declarations.py    what the sources say of attributes and results
    numbers.py         the expressions and statements of a function, number by number
    elimination.py     the linear system of rodas
    settled.py         what is fixed is settled: flags, choices, and the tests that follow
    text.py            a file, line by line: what does not change is copied with its comments
    needed.py          what nobody needs is left out
    live.py            the model in this process, as it will travel

A vector is declared by its annotation, `e: StateVector`, at a parameter, at a result or in the body of a class; what is
calculated from vectors is one; y, f and modes, with a number or without, are vectors as attributes.  Their numbers are

    y, y2, step.y0           the states' own: x, v;  x2, v2;  step.x0, step.v0
    f, f2, step.f0           the rates' own: a;  a2;  step.a0.  The rate of x is v, so that of x2 is v2: it is there
    modes, step.modes0       the contacts' own: mode;  step.mode0
    e, k3, self.c2           any other: e_x, e_v;  k3_x, k3_v;  self.c2_x, self.c2_v

A loop over contact_indices, state_indices or velocity_indices is unrolled; a function with a parameter
`i: ContactIndex` is written once for each contact.  A loop over the methods is unrolled for those that
are offered; one that tests each of them becomes a chain.
The guard of all this is that arrays, scalars and C give the same bits (tests/lowering/test_lowering.py).
"""

from .feature_selection import LAWS, METHODS, select_features
from .import_hook import function_tree, lowered_files, lowered_model, sibling_module
from .scalarize import LoweringError

__all__ = [
    "LAWS",
    "METHODS",
    "LoweringError",
    "function_tree",
    "lowered_files",
    "lowered_model",
    "select_features",
    "sibling_module",
]
