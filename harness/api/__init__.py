"""The public Python API: functions that take plain arguments and return results.

Each function imports what it needs when it is called, so that importing `harness` stays fast.
"""

from .curves import identify_curve
from .decay import identify_decay
from .descriptions import describe
from .fits import fit
from .measures import measure
from .records import read_record
from .results import load_result
from .runs import compare, simulate
from .sensitivities import sensitivity
from .sweeps import sweep

__all__ = [
    "compare",
    "describe",
    "fit",
    "identify_curve",
    "identify_decay",
    "load_result",
    "measure",
    "read_record",
    "sensitivity",
    "simulate",
    "sweep",
]
