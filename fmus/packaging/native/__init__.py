"""From the numerics in Python to an FMU that needs no Python: frozen to C, compiled for every platform.

    layout.py        the live model object becomes one struct and its initial image
    kinds.py         what a name may stand for, and how C spells it
    expressions.py, statements.py    one function of the numerics, specialised to the kinds of its arguments
    program.py       all functions that the FMI layer reaches, each once
    tangent.py       a model differentiated along a direction
    interface.py     the declared variables and the sentences, as C tables
    numerics.h, text.h               written by hand: Python's arithmetic, Python's numbers as text
    instance.h, calls.h, fmi2.c, fmi3.c    what an instance is; FMI 2.0 and 3.0, first what they have in common
    sources.py       the folder sources/ of an FMU, which any tool can compile
    compiler.py, universal.py        the binaries
    fmu.py           the file

The C does what CPython does, to the last bit: the same operations in the same order, and where Python raises, a
fault flag ends the function at the same statement.
"""

from .fmu import build

__all__ = ["build"]
