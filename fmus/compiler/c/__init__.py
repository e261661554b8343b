"""Translates the numerics from Python to C.

    struct_layout.py         the model object as structs with initializers
    c_types.py               types of values and their C spelling
    c_expressions.py, c_statements.py    translate one function for given argument types
    call_graph.py            all functions that the FMI layer reaches

The C code does what CPython does, bit for bit: the same operations in the same order. Where Python raises an exception,
a fault flag ends the function at the same statement. Loops are `while True` and `for` over a range, without
continue; the built-in functions are float and int.
"""
