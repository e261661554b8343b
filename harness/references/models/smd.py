"""Spring, mass and viscous damper."""

from functools import partial
from pathlib import Path

from ...scenes.run_spec import RunSpec
from ..certified_reference import ReferenceCase
from ..ode_problem import LinearOscillator, RhsFunction, closed_form_segments


class SmdProblem(LinearOscillator):
    """m v' = -k x - c v."""

    start, stop = (0.1, 0.0), 4.0
    m, k, c = 1.0, 157.9, 2.0

    def rates(self, mode: int) -> RhsFunction:
        square, damping = self.k / self.m, self.c / self.m
        return lambda t, y: (y[1], -square * y[0] - damping * y[1])


friction = None
solve_segments = partial(closed_form_segments, friction)
CASES = (ReferenceCase("smd", RunSpec(Path("smd.fmu"), ("x", "v")), "linear damping", "smd", SmdProblem()),)
CLOSED_FORMS = {"smd": lambda stop: solve_segments([(0.0, stop, SmdProblem().fmu_values("m", "k", "c"))])}
