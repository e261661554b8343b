"""Spring and mass with Coulomb friction."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ...scenes.run_spec import RunSpec
from ..certified_reference import ReferenceCase
from ..ode_problem import LinearOscillator, RhsFunction, closed_form_segments


class CoulombProblem(LinearOscillator):
    """m v' = -k x - f sign(v)."""

    start, stop, has_dry_friction = (0.1, 0.0), 4.0, True
    m, k, f = 1.0, 157.9, 0.5

    def rates(self, mode: int) -> RhsFunction:
        square, drag = self.k / self.m, mode * self.f / self.m
        return lambda t, y: (y[1], -square * y[0] - drag)

    def static_load(self, t: float, x: float) -> tuple[float, float, float]:
        return -self.k * x, 0.0, self.f


def friction(value: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return sliding friction and the largest load that friction holds."""
    return value["f"], value["f"]


solve_segments = partial(closed_form_segments, friction)
RUN = RunSpec(Path("coulomb.fmu"), ("x", "v"))
SIGN_RUN = replace(RUN, values={"friction": 2})
CASES = (
    ReferenceCase("coulomb", RUN, "hybrid", "coulomb", CoulombProblem()),
    ReferenceCase("coulomb-sign", SIGN_RUN, "sign", "coulomb", CoulombProblem(), "coulomb"),
)
CLOSED_FORMS = {"coulomb": lambda stop: solve_segments([(0.0, stop, CoulombProblem().fmu_values("m", "k", "f"))])}
