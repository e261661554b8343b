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


FUNCTIONS = {  # fields of Run -> functions of FMI 2.0, and those of FMI 3.0 that have other names
    "set_time": ("SetTime",),
    "set_states": ("SetContinuousStates",),
    "get_states": ("GetContinuousStates",),
    "get_rates": ("GetDerivatives", "GetContinuousStateDerivatives"),
    "get_indicators": ("GetEventIndicators",),
    "get": ("GetReal", "GetFloat64"),
    "set": ("SetReal", "SetFloat64"),
    "get_mode": ("GetInteger", "GetInt64"),
    "derive": ("GetDirectionalDerivative",),
    "update": ("NewDiscreteStates", "UpdateDiscreteStates"),
    "enter_event": ("EnterEventMode",),
    "enter_continuous": ("EnterContinuousTimeMode",),
    "save": ("GetFMUstate", "GetFMUState"),
    "restore": ("SetFMUstate", "SetFMUState"),
    "release": ("FreeFMUstate", "FreeFMUState"),
    "complete": ("CompletedIntegratorStep",),
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
        *((name, c_void_p) for name in FUNCTIONS),
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
        *((name, c_void_p) for name in ("output_states", "positions")),
        ("indicator", c_int64),
        ("is_fresh", c_bool),
        *((name, c_void_p) for name in ("influenced", "modes")),
        *((name, c_size_t) for name in ("n_influenced", "n_modes", "n_signals")),
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
