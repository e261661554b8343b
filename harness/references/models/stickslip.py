"""Drag sled pulled through a spring."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ...scenes.run_spec import RunSpec
from ..certified_reference import ReferenceCase
from ..ode_problem import LinearOscillator, RhsFunction, closed_form_segments
from ..segments import Segment

THRESHOLD = "stickslip-threshold"


class StickslipProblem(LinearOscillator):
    """m v' = k (v_driver t - x) - mu m g sign(v)."""

    start, stop, has_dry_friction = (0.0, 0.0), 16.0, True
    m, k, g, mu_s, mu_d, v_driver = 12.5, 742.5, 9.81, 0.9, 0.6, 0.034

    def rates(self, mode: int) -> RhsFunction:
        square, drag, speed = self.k / self.m, mode * self.mu_d * self.g, self.v_driver
        return lambda t, y: (y[1], square * (speed * t - y[0]) - drag)

    def static_load(self, t: float, x: float) -> tuple[float, float, float]:
        return self.k * (self.v_driver * t - x), self.k * self.v_driver, self.mu_s * self.m * self.g


VALUES = StickslipProblem().fmu_values("m", "k", "g", "mu_s", "mu_d", "v_driver")


def friction(value: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return sliding friction and the largest load that friction holds."""
    weight = value["m"] * value["g"]
    return value["mu_d"] * weight, value["mu_s"] * weight


def threshold_motion(eps: float, stop: float) -> Iterator[Segment]:
    """Return the motion under the threshold law."""
    from .. import piecewise_linear

    return piecewise_linear.threshold_segments(piecewise_linear.make_system(VALUES, friction), eps, stop)


solve_segments = partial(closed_form_segments, friction)
RUN = RunSpec(Path("stickslip.fmu"), ("x", "v"))
THRESHOLD_RUN = replace(RUN, values={"friction": 3})
CASES = (
    ReferenceCase("stickslip", RUN, "hybrid", "stickslip", StickslipProblem()),
    ReferenceCase(THRESHOLD, THRESHOLD_RUN, "threshold", THRESHOLD, StickslipProblem(), "stickslip"),
)
CLOSED_FORMS = {
    "stickslip": lambda stop: solve_segments([(0.0, stop, VALUES)]),
    THRESHOLD: lambda stop: threshold_motion(1e-7, stop),
}
