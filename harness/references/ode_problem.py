"""Oscillators in the form that the user of another solver writes: equations and modes, independent of the FMUs.

    d(x, v)/dt = rates(mode)(t, (x, v)),    mode = -1 sliding backward, 0 stuck, 1 sliding forward

With dry friction, a problem slides in one mode until v = 0 and then takes the mode from `resolve_mode`; while stuck, it
waits for `breakaway`.  All quantities are in SI units.
"""

from collections.abc import Callable, Iterator, Sequence
from math import copysign, inf

import numpy as np

from .piecewise_linear import solve_segments
from .segments import FrictionLaw, ParameterSpan, ParameterValues, Segment

StateVector = Sequence[float] | np.ndarray
RhsFunction = Callable[[float, StateVector], tuple[float, float]]
JacobianFunction = Callable[[float, StateVector], list[list[float]]]


class OdeProblem:
    """An initial value problem from t = 0 on.

    Attributes
    ----------
    start : (float, float)
        Initial position (in `unit`) and velocity.
    stop : float
        Stop time in s.
    has_dry_friction : bool
        Whether the body can stick.
    is_stiff : bool
        Whether peers need an implicit method.
    atol_factor : float
        Absolute tolerance divided by the relative one.
    """

    start: tuple[float, float]
    stop: float
    unit = "m"
    has_dry_friction = is_stiff = False
    atol_factor = 1e-3  # SI units

    def fmu_values(self, *names: str) -> ParameterValues:
        """Return parameters and initial values by their names in the FMU, for the closed form."""
        return {n: getattr(self, n) for n in names} | {"x0": self.start[0], "v0": self.start[1], "F_ext": 0.0}

    def rates(self, mode: int) -> RhsFunction:
        """Return the right-hand side in a mode of sliding."""
        raise NotImplementedError

    def jacobian(self, mode: int) -> JacobianFunction | None:
        """Return the Jacobian of the right-hand side; None leaves it to the solver."""
        return None

    def static_load(self, t: float, x: float) -> tuple[float, float, float]:
        """Return the load on the body at rest, its rate, and the largest load that friction holds."""
        raise NotImplementedError

    def resolve_mode(self, t: float, x: float, v: float) -> int:
        """Return the mode that begins at time t."""
        if not self.has_dry_friction:
            return 1
        load, _, limit = self.static_load(t, x)
        return int(copysign(1, v)) if v else int(copysign(1, load)) if abs(load) > limit else 0

    def breakaway(self, t: float, x: float) -> tuple[float, int]:
        """Return the time in s and the direction of the break-away of a stuck body; the load is linear in time."""
        load, rate, limit = self.static_load(t, x)
        direction = int(copysign(1, rate))
        return (t + (limit - direction * load) / abs(rate), direction) if rate else (inf, 0)


class LinearOscillator(OdeProblem):
    """A mass on a spring, with or without a viscous damper."""

    m: float
    k: float
    c = 0.0

    def jacobian(self, mode: int) -> JacobianFunction | None:
        matrix = [[0.0, 1.0], [-self.k / self.m, -self.c / self.m]]
        return lambda t, y: matrix


class UnspecifiedProblem(OdeProblem):
    """A model without an independent implementation, which peers cannot solve."""

    def __init__(self, stop: float) -> None:
        self.stop = stop


def closed_form_segments(friction: FrictionLaw | None, spans: list[ParameterSpan]) -> Iterator[Segment]:
    """Return the motion over the spans in closed form, with or without dry friction."""
    return solve_segments(spans, friction)
