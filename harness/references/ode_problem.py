"""The oscillators as the user of another solver writes them: equations and modes, typed apart from the FMUs.

    d(x, v)/dt = rates(mode)(t, (x, v)),    mode = -1 sliding backward, 0 stuck, 1 sliding forward

A dry problem slides in one mode until v = 0, then goes where `settle` says; stuck, it waits for `release`.
SI units throughout.
"""

from collections.abc import Callable, Iterator, Sequence
from math import copysign, inf

import numpy as np

from .segments import Friction, ParameterSpan, ParameterValues, Segment

StateVector = Sequence[float] | np.ndarray
RhsFunction = Callable[[float, StateVector], tuple[float, float]]
JacobianFunction = Callable[[float, StateVector], list[list[float]]]


class OdeProblem:
    """One run from `start` (position in `unit`, and speed) at t = 0 to `stop` (s); `absolute` is the tolerance below
    which errors do not matter, as a share of the relative one."""

    start: tuple[float, float]
    stop: float
    unit = "m"
    has_dry_friction = is_stiff = False
    atol_factor = 1e-3  # SI units

    def values(self, *names: str) -> ParameterValues:
        """Its parameters and its start by their names in the FMU, for its closed form."""
        return {n: getattr(self, n) for n in names} | {"x0": self.start[0], "v0": self.start[1], "F_ext": 0.0}

    def rates(self, mode: int) -> RhsFunction:
        """The right-hand side in a mode of sliding."""
        raise NotImplementedError

    def jacobian(self, mode: int) -> JacobianFunction | None:
        """Its derivatives by the state; None leaves them to the solver."""
        return None

    def hold(self, t: float, x: float) -> tuple[float, float, float]:
        """Load on the body at rest, its rate, and what friction can hold."""
        raise NotImplementedError

    def resolve_mode(self, t: float, x: float, v: float) -> int:
        """The mode that holds from here on."""
        if not self.has_dry_friction:
            return 1
        load, _, limit = self.hold(t, x)
        return int(copysign(1, v)) if v else int(copysign(1, load)) if abs(load) > limit else 0

    def breakaway(self, t: float, x: float) -> tuple[float, int]:
        """When a stuck body breaks away, and in which direction; the load is linear in time."""
        load, rate, limit = self.hold(t, x)
        direction = int(copysign(1, rate))
        return (t + (limit - direction * load) / abs(rate), direction) if rate else (inf, 0)


class LinearOscillator(OdeProblem):
    """A mass on a spring, with a viscous damper or without."""

    m: float
    k: float
    c = 0.0

    def jacobian(self, mode: int) -> JacobianFunction | None:
        matrix = [[0.0, 1.0], [-self.k / self.m, -self.c / self.m]]
        return lambda t, y: matrix


class UnspecifiedProblem(OdeProblem):
    """A model that nobody has written a second time: there is nothing to ask a peer."""

    def __init__(self, stop: float) -> None:
        self.stop = stop


def closed_form_segments(friction: Friction | None, spans: list[ParameterSpan]) -> Iterator[Segment]:
    """The motion over the spans in closed form, with dry friction if there is any."""
    from .piecewise_linear import pieces  # which needs a package that not everybody has

    return pieces(spans, friction)
