"""External anchors: two problems of other people, solved by the runtime, with the peers beside it.

1. The block on a belt, whose friction falls with the relative speed (R. I. Leine, Bifurcations in Discontinuous
   Mechanical Systems of Filippov-Type, 2000).
2. The chattering classic: friction so strong that the mass stops for good within half a second.  As plain sign(v)
   it never comes to an end, with any solver; with modes it is one event.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import fabs, sqrt

import numpy as np

from fmus.packaging.catalogue import load
from fmus.runtime.automaton import DryFriction
from fmus.runtime.codes import HYBRID, ODE45
from fmus.runtime.declare import Choice
from fmus.runtime.march import March
from fmus.runtime.methods import ITEMS

from ...errors import HarnessError
from ...running.answer import Answer
from ...running.inside import Inside, offered
from ...truths import peers
from ...truths.problem import Belt, Classic, Equations, Plain, Smoothed

LIMIT = 20_000  # right-hand sides after which a run counts as without end
RUNTIME, EVENTS = "this runtime", "events"


class Solver(March):
    method = Choice(ODE45, "integration method", ITEMS)


class Block(DryFriction):
    """Block on a belt, seen from the belt, where it sticks at zero speed: y = x - belt t.

    y'' = -(y + belt t) - F_friction          m = k = F_s = 1 in SI units
    sliding:   F_friction = sign(v)/(1 + 3 |v|)
    stuck:     v = 0 while |y + belt t| <= 1
    """

    friction = HYBRID
    stop_time = 50.0
    belt = 0.2  # m/s

    def __init__(self):
        super().__init__()
        self.solver = Solver()

    def initial(self, t):
        return 1.067, -self.belt

    def rates(self, t, x, v, mode):
        return -(x + self.belt * t) - mode / (1.0 + 3.0 * mode * v)

    def jacobian(self, t, x, v, mode):
        fall = 1.0 + 3.0 * mode * v
        return -self.belt, -1.0, 3.0 / (fall * fall)

    def hold(self, t, x, v):
        return -(x + self.belt * t), -self.belt, 1.0

    def terms(self, t, x, v):
        return fabs(x) + fabs(self.belt * t)


@dataclass(frozen=True)
class AnchorRun:
    """One solver: `error` is the larger of those of position (m) and speed (m/s) at the end; or the failure."""

    problem: str
    solver: str
    method: str
    rtol: float
    evaluations: int | None
    error: float
    failure: str = ""


# End of the block in the belt's frame; two methods at 1e-12 agree in these digits, and the published figures, x =
# -0.2992525 and v = -0.6308870 in the room's frame, in all of theirs.
BLOCK = (-0.29925249924 - 50.0 * 0.2, -0.63088695537 - 0.2)
CLASSIC = (sqrt(125.0) - 10.0, 0.0)  # x = -10 + 10 cos t + 5 sin t up to its first turning point
TIGHT = {"RK23": 1e-6, "ode23": 1e-6, "DOP853": 1e-10, "dop853": 1e-10}  # and 1e-8 for the others


def analyse() -> Iterator[AnchorRun]:
    """Both anchors with every method of the runtime, then with the peers."""
    name = "block on a belt"
    yield from runtime(name, Block, {}, Belt.stop, BLOCK)
    yield from others(name, Belt(), BLOCK, EVENTS, {"scipy": ("RK23", "RK45", "DOP853", "LSODA"), "cvode": ("Adams",)})
    yield from others(name, Smoothed(), BLOCK, "arctan(1e6 v)", {"scipy": ("RK45", "LSODA")})
    name, values = "chattering classic", {"m": 1.0, "k": 1.0, "f": 10.0, "x0": 0.0, "v0": 5.0}
    yield from runtime(name, load("coulomb"), values, Classic.stop, CLASSIC)
    yield from others(name, Classic(), CLASSIC, EVENTS, {"scipy": ("RK23", "RK45", "LSODA")})
    yield from others(name, Plain(), CLASSIC, "plain sign(v)", {"scipy": ("RK23", "RK45", "LSODA", "Radau")})


def runtime(
    name: str, model: type, values: dict[str, float], stop: float, end: tuple[float, float]
) -> Iterator[AnchorRun]:
    """Every method that the runtime offers for a model, up to the stop in s."""
    for method in offered(model):
        rtol = TIGHT.get(method, 1e-8)
        run = Inside.prepared(model, values, method, rtol, 1e-3 * rtol)
        yield row(partial(AnchorRun, name, RUNTIME, method, rtol), partial(run.answer, [0.0, stop]), end)


def others(
    name: str, problem: Equations, end: tuple[float, float], way: str, methods: dict[str, tuple[str, ...]]
) -> Iterator[AnchorRun]:
    """The peers that are installed."""
    times = np.array([0.0, problem.stop])
    for peer in (peer for peer in methods if peer not in peers.missing()):
        for method in methods[peer]:
            rtol = TIGHT.get(method, 1e-8)
            ask = partial(peers.solve, peer, method, problem, times, rtol, 1e-3 * rtol, peers.at_most(LIMIT))
            yield row(partial(AnchorRun, name, f"{peer}, {way}", method, rtol), ask, end)


def row(begin: Callable[..., AnchorRun], ask: Callable[[], Answer], end: tuple[float, float]) -> AnchorRun:
    """One line of the table."""
    try:
        answer = ask()
    except HarnessError as error:
        return begin(None, float("nan"), str(error))
    return begin(answer.evaluations, float(np.abs(answer.motion[-1] - end).max()))
