"""The compiled loop of variational_events.c, and its structs."""

from ctypes import CDLL, Structure, c_bool, c_double, c_int64, c_size_t, c_uint32, c_void_p
from functools import cache
from pathlib import Path

from ..errors import HarnessError, install_command
from .whole_run import compile_library

SOURCE = Path(__file__).with_name("variational_events.c")
REACHED, EVENT, GRAZE, STEP_EVENT, TERMINATED, FAILED, TOO_MANY_STEPS = range(7)  # of variational.c
EVENT_TERMINATED, EARLY_EVENT, UNSETTLED, NO_SAVED_STATE, NO_NEIGHBOUR, NO_VALUE, NO_END, LOG_FULL = range(7, 15)
NOT_SET, TUNABLE, FIXED = range(3)  # kinds of parameters
NO_SIDE = 2
REASONS = (  # for which derivatives do not exist
    "no event indicator shows the event",
    "two events happen at once",
    "a limit is touched, but not passed",
    "the event happens only just",
    "the event may depend on a fixed parameter",
    "sticking and sliding on are both possible",
    "two modes are possible",
    "an event happens then",
)
RECORDED = 7


class ParameterStruct(Structure):
    """The struct Parameter of variational.c."""

    _fields_ = (
        ("reference", c_uint32),
        ("is_start", c_bool),
        ("input", c_int64),
        ("value", c_double),
        ("kind", c_int64),
        ("side", c_int64),
        ("change", c_double),
        ("starts", c_void_p * 5),
    )


FUNCTION_FIELDS = ("set_time", "set_states", "get_rates", "get_indicators", "get", "set", "derive", "complete")
EVENT_FIELDS = ("update", "enter_event", "enter_continuous", "get_states", "get_mode", "save", "restore", "release")
EVENT_FUNCTIONS = {
    "2.0": (
        *("NewDiscreteStates", "EnterEventMode", "EnterContinuousTimeMode", "GetContinuousStates", "GetInteger"),
        *("GetFMUstate", "SetFMUstate", "FreeFMUstate"),
    ),
    "3.0": (
        *("UpdateDiscreteStates", "EnterEventMode", "EnterContinuousTimeMode", "GetContinuousStates", "GetInt64"),
        *("GetFMUState", "SetFMUState", "FreeFMUState"),
    ),
}
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
LOGS = ("event_values", "note_values", "split_values", "event_codes", "note_codes")
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
        ("output_states", c_void_p),
        ("indicator", c_int64),
        ("is_fresh", c_bool),
        *((name, c_void_p) for name in EVENT_FIELDS),
        ("influenced", c_void_p),
        ("modes", c_void_p),
        *((name, c_size_t) for name in ("n_influenced", "n_modes")),
        ("n_signals", c_size_t),
        ("signals", c_void_p),
        *((name, c_double) for name in ("duration", "tolerance", "next_event", "row", "last_t")),
        *((name, c_size_t) for name in ("n_at_once", "capacity", "capacity_notes", "n_events", "n_notes", "n_splits")),
        *((name, c_void_p) for name in LOGS),
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
    library.set_table.restype = c_double
    return library
