"""Translates the numerics from Python to C and compiles them to FMUs that need no Python, for every platform.

    struct_layout.py             the model object as structs with initializers
    c_types.py                   types of values and their C spelling
    expressions.py, statements.py    translate one function for given argument types
    call_graph.py                all functions that the FMI layer reaches
    directional_derivative.py    differentiates a model (forward mode)
    model_header.py              model.h: the functions that the FMI layer calls, the variables and the messages
    python_arithmetic.h, text_buffer.h, stderr_output.h    Python's arithmetic, number formatting, messages
    variable.h, saved_state.h, instance.h, common_functions.h, fmi2.c, fmi3.c    the FMI layer
    sources.py                   the folder sources/ of an FMU, which any C compiler can build
    compiler.py                  the binaries
    fmu.py                       the FMU file

The C code does what CPython does, bit for bit: the same operations in the same order. Where Python raises an exception,
a fault flag ends the function at the same statement.
"""

from .fmu import build

__all__ = ["build"]
