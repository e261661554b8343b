"""The public Python API: functions that take plain arguments and return results.

Each function imports what it needs when it is called, so that importing `harness` stays fast.
"""

from .fits import fit
from .orbits import map_motions, orbit
from .records import identify_curve, identify_decay, measure, read_record
from .runs import compare, describe, load_result, sensitivity, simulate
from .sweeps import sweep

__all__ = [
    "compare",
    "describe",
    "fit",
    "identify_curve",
    "identify_decay",
    "load_result",
    "map_motions",
    "measure",
    "orbit",
    "read_record",
    "sensitivity",
    "simulate",
    "sweep",
]
