"""Spring and mass with Coulomb friction."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from ..problem import Linear, Rates, closed
from ..reference import Case


class Coulomb(Linear):
    """m v' = -k x - f sign(v)."""

    start, stop, dry = (0.1, 0.0), 4.0, True
    m, k, f = 1.0, 157.9, 0.5

    def rates(self, mode: int) -> Rates:
        square, drag = self.k / self.m, mode * self.f / self.m
        return lambda t, y: (y[1], -square * y[0] - drag)

    def hold(self, t: float, x: float) -> tuple[float, float, float]:
        return -self.k * x, 0.0, self.f


def friction(value: Mapping[str, Any]) -> tuple[Any, Any]:
    """What slides and what holds."""
    return value["f"], value["f"]


pieces = partial(closed, friction)
CASES = (
    Case("coulomb", "coulomb", "hybrid", "coulomb", Coulomb()),
    Case("coulomb-sign", "coulomb", "sign", "coulomb", Coulomb(), {"friction": 2}, "coulomb"),
)
CLOSED = {"coulomb": lambda stop: pieces([(0.0, stop, Coulomb().values("m", "k", "f"))])}
