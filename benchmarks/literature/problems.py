"""Test problems from the literature: an oscillator that chatters, and a block on a belt, each in two formulations."""

from math import atan, copysign, fabs, pi

from harness.references.models.coulomb import CoulombProblem
from harness.references.ode_problem import JacobianFunction, OdeProblem, RhsFunction


class ChatteringOscillator(CoulombProblem):
    """Classic chattering problem: strong friction stops the mass within half a second and holds it."""

    start, stop = (0.0, 5.0), 10.0 * pi
    m, k, f = 1.0, 1.0, 10.0


class ChatteringOscillatorSign(ChatteringOscillator):
    """The same problem with sign(v): one equation without modes, in which the mass never stops."""

    has_dry_friction = False

    def rates(self, mode: int) -> RhsFunction:
        return lambda t, y: (y[1], -y[0] - (copysign(10.0, y[1]) if y[1] else 0.0))

    jacobian = OdeProblem.jacobian


class BeltBlock(OdeProblem):
    """Block on a belt (R. I. Leine, Bifurcations in Discontinuous Mechanical Systems of Filippov-Type, 2000).

    m = k = F_s = 1 in SI units.  In the frame of the belt, y = x - 0.2 t, the block sticks where its velocity is zero:

    y'' = -(y + 0.2 t) - sign(v)/(1 + 3 |v|),    stuck while |y + 0.2 t| <= 1
    """

    start, stop, has_dry_friction = (1.067, -0.2), 50.0, True

    def rates(self, mode: int) -> RhsFunction:
        return lambda t, y: (y[1], -(y[0] + 0.2 * t) - mode / (1 + 3 * mode * y[1]))

    def jacobian(self, mode: int) -> JacobianFunction | None:
        return lambda t, y: [[0.0, 1.0], [-1.0, 3 / (1 + 3 * mode * y[1]) ** 2]]

    def static_load(self, t: float, x: float) -> tuple[float, float, float]:
        return -(x + 0.2 * t), -0.2, 1.0


class SmoothedBeltBlock(BeltBlock):
    """Block on a belt with friction smoothed to a steep arctan: it creeps where it should stick."""

    has_dry_friction = False
    steepness = 1e6  # s/m

    def rates(self, mode: int) -> RhsFunction:
        share, steepness = 2 / pi, self.steepness
        return lambda t, y: (
            y[1],
            -(y[0] + 0.2 * t) - share * atan(steepness * y[1]) / (1 + 3 * fabs(y[1])),
        )

    jacobian = OdeProblem.jacobian
