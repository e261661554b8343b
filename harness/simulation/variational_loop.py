"""The compiled loop of variational.c, and its structs."""

from ctypes import CDLL, Structure, c_bool, c_double, c_int64, c_size_t, c_uint32, c_void_p
from functools import cache
from pathlib import Path

from ..errors import HarnessError, install_command
from .whole_run import compile_library

SOURCE = Path(__file__).with_name("variational.c")
REACHED, EVENT, GRAZE, STEP_EVENT, TERMINATED, FAILED, TOO_MANY_STEPS = range(7)  # of variational.c


class ParameterStruct(Structure):
    """The struct Parameter of variational.c."""

    _fields_ = (
        ("reference", c_uint32),
        ("width", c_size_t),
        ("element", c_size_t),
        ("input", c_int64),
        ("value", c_double),
    )


FUNCTION_FIELDS = ("set_time", "set_states", "get_rates", "get_indicators", "get", "set", "derive", "complete")
FUNCTIONS = {
    "2.0": ("SetTime", "SetContinuousStates", "GetDerivatives", "GetEventIndicators", "GetReal", "SetReal"),
    "3.0": (
        "SetTime",
        "SetContinuousStates",
        "GetContinuousStateDerivatives",
        "GetEventIndicators",
        "GetFloat64",
        "SetFloat64",
    ),
}
ARRAYS = (
    *("z", "z1", "k", "dense", "largest", "nominals", "g", "g1", "samples"),
    *("largest_g", "t_far", "g_far", "touch", "work"),
)
TABLEAU = {"a": "A", "c": "C", "b": "B", "e3": "E3", "e5": "E5", "a_extra": "A_EXTRA", "c_extra": "C_EXTRA", "d": "D"}


class RunStruct(Structure):
    """The struct Run of variational.c."""

    _fields_ = (
        ("instance", c_void_p),
        *((name, c_void_p) for name in FUNCTION_FIELDS),
        ("fmi", c_int64),
        *((name, c_size_t) for name in ("n", "m", "q", "r", "n_inputs")),
        *((name, c_void_p) for name in ("states", "rates", "outputs", "inputs", "parameters")),
        *((name, c_void_p) for name in TABLEAU),
        ("table", c_void_p),
        *((name, c_double) for name in ("rtol", "graze")),
        *((name, c_size_t) for name in ("max_steps", "n_steps", "n_rhs")),
        *((name, c_double) for name in ("t", "h", "t_event")),
        *((name, c_void_p) for name in ARRAYS),
        ("times", c_void_p),
        ("n_times", c_size_t),
        ("next", c_size_t),
        ("values", c_void_p),
        ("indicator", c_int64),
        ("is_fresh", c_bool),
    )


@cache
def load_library() -> CDLL:
    """Return the compiled loop.

    Raises
    ------
    HarnessError
        If there is no compiler.
    """
    library = compile_library(SOURCE)
    if library is None:
        raise HarnessError(f"derivatives need a C compiler, and there is none: {install_command('native')}")
    library.indicator_slope.restype = library.moved_indicator.restype = c_double
    return library
