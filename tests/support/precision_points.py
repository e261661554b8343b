"""Points of work-precision diagrams, without a run."""

from harness.studies.precision.study import FMU, Point


def make_point(method, seconds, largest, tool=FMU, case="stickslip", **others):
    """Return a point of a method: its run time in s and its largest error."""
    return Point(case, tool, method, 1e-6, 1e-9, seconds=seconds, evaluations=1, largest=largest, **others)
