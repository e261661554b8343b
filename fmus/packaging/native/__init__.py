"""Builds FMUs that need no Python, for every platform: the FMI functions in C around a translated model.

directional_derivative.py    differentiates a model (forward mode)
model_header.py              model.h: the functions that the FMI layer calls, the variables and the messages
python_arithmetic.h, text_buffer.h, stderr_output.h    Python's arithmetic, number formatting, messages
variable.h, saved_state.h, instance.h, common_functions.h, fmi2.c, fmi3.c    the FMI layer
binaries.py                  the compiled binaries
native_fmu.py                the FMU file, with the folder sources/, which any C compiler can build
"""
