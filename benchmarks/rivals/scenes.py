"""The scenes that all rivals simulate, and the solution that a rival returns.

In every scene one body slides on a partner: the ground, a belt, or a second inertia.

    inertia v' = load(t, x) - F,   partner w' = F,   x' = v,   slip = v - w
    sliding:   F = slide(t, |slip|) sign(slip)
    stuck:     slip = 0 while |F| <= hold(t)

The ground and the belt have an infinite inertia, so that w is constant. The states of a solution are x, v, w at the
internal steps, or at least at the compared points; its events are the changes of mode (-1, 0 stuck, 1), None for an
engine without modes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, inf, pi, sin

import numpy as np

from benchmarks.literature.study import BeltBlock
from harness.references.models.coulomb import CoulombProblem
from harness.references.models.pendulum import PendulumProblem
from harness.references.models.stickslip import StickslipProblem
from harness.simulation.solution import Events as Events
from harness.simulation.solution import Solution as Solution

Setting = dict[str, float | str]  # options of an engine by name; empty for its defaults


class NotOfferedError(Exception):
    """An engine does not offer what a scene needs; the text is the reason."""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One body with friction.

    Attributes
    ----------
    name, title : str
        Name on the command line, and name in tables and figures.
    stop, interval : float
        Duration of the scene and distance of the compared points, in s.
    start : (float, float, float)
        Position x, speed v, and speed w of the partner at 0 s.
    load : callable
        Force on the body without friction, as a function of time and position.
    slide : callable
        Sliding friction, as a function of time and of the size of the slip.
    hold : callable
        Largest friction at rest, as a function of time.
    level : float
        Slip in m/s or rad/s above which a motion without modes counts as slipping.
    inertia, partner : float
        Inertia of the body and of its partner.
    stiffness : float
        Stiffness of the spring that is a part of the load.
    unit : str
        Unit of the error: that of x, or of both speeds with a second inertia.
    has_one_coefficient : bool
        Whether static and sliding friction are the same constant.
    has_constant_sliding : bool
        Whether sliding friction is constant.
    is_rotation : bool
        Whether x is an angle.
    """

    name: str
    title: str
    stop: float
    interval: float
    start: tuple[float, float, float]
    load: Callable[[float, float], float]
    slide: Callable[[float, float], float]
    hold: Callable[[float], float]
    level: float
    inertia: float
    partner: float = inf
    stiffness: float = 0.0
    unit: str = "m"
    has_one_coefficient: bool = False
    has_constant_sliding: bool = True
    is_rotation: bool = False

    @property
    def times(self) -> np.ndarray:
        """Return the compared points (n,) in s, from 0 to the stop."""
        return np.linspace(0.0, self.stop, round(self.stop / self.interval) + 1)

    @property
    def has_second_inertia(self) -> bool:
        """Return whether the partner moves freely."""
        return self.partner < inf

    @property
    def compared_columns(self) -> slice:
        """Return the states that are compared."""
        return slice(1, 3) if self.has_second_inertia else slice(0, 1)


def sample(solution: Solution, times: np.ndarray) -> np.ndarray:
    """Return the states (len(times), 3), linear between two steps."""
    return np.column_stack([np.interp(times, solution.times, column) for column in solution.states.T])


def slip_changes(solution: Solution, level: float) -> Events:
    """Return the times in s at which a slip begins (1) and ends (0): its size passes the level."""
    slip, changes, t = solution.states[:, 1] - solution.states[:, 2], Events(), solution.times
    for side in (1, -1):
        excess = side * slip - level
        i = np.flatnonzero((excess[1:] > 0.0) != (excess[:-1] > 0.0))
        times = t[i] + excess[i] / (excess[i] - excess[i + 1]) * (t[i + 1] - t[i])
        changes += [(t, int(begins)) for t, begins in zip(times.tolist(), excess[i + 1] > 0.0, strict=True)]
    return sorted(changes)


REST, SLED, BELT, PENDULUM = CoulombProblem(), StickslipProblem(), BeltBlock(), PendulumProblem()
WEIGHT = SLED.m * SLED.g
TORQUE = PENDULUM.m * PENDULUM.g * PENDULUM.a
PIN_FRICTION = PENDULUM.mu * PENDULUM.r * PENDULUM.m * PENDULUM.g

SCENES = {
    scene.name: scene
    for scene in (
        Scene(
            name="rest",
            title="release and rest",
            stop=6.0,
            interval=0.02,
            start=(*REST.start, 0.0),
            load=lambda t, x: -REST.k * x,
            slide=lambda t, slip: REST.f,
            hold=lambda t: REST.f,
            level=0.01,
            inertia=REST.m,
            stiffness=REST.k,
            has_one_coefficient=True,
        ),
        Scene(
            name="sled",
            title="drag sled",
            stop=SLED.stop,
            interval=0.04,
            start=(*SLED.start, 0.0),
            load=lambda t, x: SLED.k * (SLED.v_driver * t - x),
            slide=lambda t, slip: SLED.mu_d * WEIGHT,
            hold=lambda t: SLED.mu_s * WEIGHT,
            level=0.01,
            inertia=SLED.m,
            stiffness=SLED.k,
        ),
        Scene(
            name="held",
            title="load of 0.9 of the limit",
            stop=5.0,
            interval=0.1,
            start=(0.0, 0.0, 0.0),
            load=lambda t, x: 0.9 * SLED.mu_d * WEIGHT,
            slide=lambda t, slip: SLED.mu_d * WEIGHT,
            hold=lambda t: SLED.mu_d * WEIGHT,
            level=0.01,
            inertia=SLED.m,
            has_one_coefficient=True,
        ),
        Scene(
            name="belt",
            title="block on a belt",
            stop=BELT.stop,
            interval=0.1,
            start=(BELT.start[0], 0.0, 0.2),
            load=lambda t, x: -x,
            slide=lambda t, slip: 1.0 / (1.0 + 3.0 * slip),
            hold=lambda t: 1.0,
            level=0.02,
            inertia=1.0,
            stiffness=1.0,
            has_constant_sliding=False,
        ),
        Scene(
            name="clutch",
            title="two-inertia clutch",
            stop=1.2,
            interval=0.02,
            start=(0.0, 10.0, 0.0),
            load=lambda t, x: 10.0 * sin(10.0 * pi * t),
            slide=lambda t, slip: 10.0 * cos(0.4 * pi * t),
            hold=lambda t: 11.0 * cos(0.4 * pi * t),
            level=0.1,
            inertia=1.0,
            partner=1.0,
            unit="rad/s",
            has_constant_sliding=False,
            is_rotation=True,
        ),
        Scene(
            name="pendulum",
            title="pendulum with friction",
            stop=PENDULUM.stop,
            interval=0.02,
            start=(*PENDULUM.start, 0.0),
            load=lambda t, x: -TORQUE * sin(x),
            slide=lambda t, slip: PIN_FRICTION,
            hold=lambda t: PIN_FRICTION,
            level=0.01,
            inertia=PENDULUM.inertia,
            unit="rad",
            has_one_coefficient=True,
            is_rotation=True,
        ),
    )
}
