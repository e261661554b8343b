"""Names that variables of a model must not use: those of generated Python, and those reserved in C."""

from inspect import get_annotations
from keyword import iskeyword

from ...runtime.contact_lcp import CoupledFriction
from ...runtime.method_registry import methods
from ...runtime.oscillator import Oscillator
from ...runtime.planar_contact import PlanarFriction
from ...runtime.stick_slip import DryFriction
from .expressions import FUNCTIONS, Expression, ModelError
from .model_declaration import Model

MATH = ("copysign", "inf", "nan", "pi", *FUNCTIONS)
IMPORTS = {  # module -> names that generated code may import
    "": tuple(label for label, _, _ in methods),
    "stick_slip": ("HYBRID_LAW", "SIGN_LAW", "THRESHOLD_LAW", "DryFriction", "sign", "threshold"),
    "codes": ("EXACT", "HYBRID", "MODEL_RULE", "OK"),
    "input_polynomial": ("InputPolynomial", "PrescribedMotion"),
    "contact_lcp": ("CoupledFriction",),
    "planar_contact": ("PlanarFriction", "slip_direction", "slip_turn"),
    "variable_declarations": ("Enumeration", "VariableDeclaration"),
    "integrator": ("Integrator",),
    "active_method": ("EXACT_ITEM", "METHOD_ITEMS"),
    "oscillator": ("Oscillator",),
}
CLASSES = ("Solver", "Model", "Fmi3Slave")
BASES = (Model, Oscillator, DryFriction, CoupledFriction, PlanarFriction)  # of declared and generated classes
ATTRIBUTES = {name for base in BASES for name in (*dir(base), *get_annotations(base)) if not name.startswith("_")}
FMI_NAMES = ("time", "solver", "events")  # of variables that each FMU has
RESERVED_NAMES = {
    *("self", "t", *MATH, *ATTRIBUTES, *FMI_NAMES, *CLASSES),
    *(name for names in IMPORTS.values() for name in names),
}

INTEGER_TYPES = """
    CHAR SCHAR UCHAR SHRT USHRT INT UINT LONG ULONG LLONG ULLONG SIZE WCHAR
    PTRDIFF INTMAX UINTMAX INTPTR UINTPTR WINT SIG_ATOMIC SSIZE PATH
    INT8 INT16 INT32 INT64 INT_FAST8 INT_FAST16 INT_FAST32 INT_FAST64 INT_LEAST8 INT_LEAST16 INT_LEAST32 INT_LEAST64
    UINT8 UINT16 UINT32 UINT64 UINT_FAST8 UINT_FAST16 UINT_FAST32 UINT_FAST64
    UINT_LEAST8 UINT_LEAST16 UINT_LEAST32 UINT_LEAST64
""".split()  # noqa: SIM905
C_NAMES = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    bool true false fault
    BUFSIZ EOF FILENAME_MAX FOPEN_MAX HUGE_VAL HUGE_VALF HUGE_VALL INFINITY MINUS_INFINITY MODEL_GUID MODEL_H MODEL_NAME
    NAN NULL NDEBUG NO_OFFSET RAND_MAX SEEK_CUR SEEK_END SEEK_SET TMP_MAX TOLERANCE errno offsetof stderr stdin stdout
    COLD FMI MAX_INTEGER STATUS_DISCARD STATUS_ERROR STATUS_OK
    DOMAIN EDOM ERANGE EXIT_FAILURE EXIT_SUCCESS HUGE OVERFLOW PLOSS SING TLOSS UNALIGNED UNDERFLOW environ matherr
    F_LOCK F_OK F_TEST F_TLOCK F_ULOCK L_INCR L_SET L_XTND L_tmpnam P_DETACH P_NOWAIT P_OVERLAY P_WAIT P_tmpdir R_OK
    W_OK X_OK M_1_PI M_2_PI M_2_SQRTPI M_E M_LN10 M_LN2 M_LOG10E M_LOG2E M_PI M_PI_2 M_PI_4 M_SQRT1_2 M_SQRT2
    CHAR_BIT NSIG SIGABRT SIGBREAK SIGFPE SIGILL SIGINT SIGSEGV SIGTERM SIG_DFL SIG_ERR SIG_IGN
    """.split()  # noqa: SIM905
) | {f"{name}_{bound}" for name in INTEGER_TYPES for bound in ("MAX", "MIN")}

FMI_PREFIXES = ("fmi2", "fmi3", "FMI2_", "FMI3_")  # of functions, types and macros of the FMI headers


def is_reserved_in_c(name: str) -> bool:
    """Return whether a name is a keyword of C, a macro of its headers, or may be one of the FMI headers."""
    return name in C_NAMES or name.startswith(FMI_PREFIXES)


def check_name(name: str, e: Expression) -> None:
    """Raise ModelError for a name that a variable of a model cannot have."""
    if not name.isidentifier():
        raise ModelError(
            f"the name {name!r} is no identifier: use letters, digits and _, and no digit at the start", e.location
        )
    if name in RESERVED_NAMES or is_reserved_in_c(name) or iskeyword(name) or name.startswith("_"):
        raise ModelError(f"the name {name} is reserved by the solver or by C: choose another name", e.location)
    if not name.isascii():
        raise ModelError(f"the name {name} is not ASCII, as C requires: choose another name", e.location)
