"""Points of work-precision diagrams, without a run."""

from harness import PrecisionResult
from harness.references.peer_solvers import FMU
from harness.studies.precision.study import Point, PrecisionCase

CASES = {
    "stickslip": PrecisionCase("stickslip", "hybrid", {}),
    "stickslip-threshold": PrecisionCase("stickslip-threshold", "threshold", {}, is_chattering=True),
}


def make_point(method, seconds, largest, tool=FMU, case="stickslip", **others):
    """Return a point of a method: its run time in s and its largest error."""
    return Point(case, tool, method, 1e-6, 1e-9, seconds=seconds, evaluations=1, largest=largest, **others)


def make_study(*points, cases=("stickslip",), min_ratio=0.0):
    """Return the result of a sled with these points."""
    return PrecisionResult("stickslip", tuple(CASES[name] for name in cases), points, min_ratio=min_ratio)
