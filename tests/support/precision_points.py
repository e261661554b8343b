"""Points of work-precision diagrams, without a run."""

from harness.studies.precision.study import FMU, Point, StudiedCase, Study

CASES = {
    "stickslip": StudiedCase("stickslip", "hybrid", {}),
    "stickslip-threshold": StudiedCase("stickslip-threshold", "threshold", {}, is_chattering=True),
}


def make_point(method, seconds, largest, tool=FMU, case="stickslip", **others):
    """Return a point of a method: its run time in s and its largest error."""
    return Point(case, tool, method, 1e-6, 1e-9, seconds=seconds, evaluations=1, largest=largest, **others)


def make_study(*points, cases=("stickslip",)):
    """Return the study of a sled with these points."""
    return Study("stickslip", tuple(CASES[name] for name in cases), points)
