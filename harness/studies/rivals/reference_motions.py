"""Reference motions of the scenes: closed forms, and solutions whose events are located; none comes from an FMU."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from ...references import event_located, peer_solvers
from ...references.reference_trajectory import CommunicationGrid, compute_reference
from .scenes import BELT, PENDULUM, REST, SLED, Changes, Motion, Scene

RTOL, ATOL = event_located.TOLERANCES["DOP853"]
FINE = 20  # points per compared interval, to find when the slip passes a level
ROUNDING = 1e-12  # m/s or rad/s: a smaller slip of a reference is zero


@dataclass(frozen=True)
class ReferenceMotion:
    """The reference of a scene.

    Attributes
    ----------
    states : (n, 3) at the times of the scene, as in Motion
    is_stuck : (n,) whether the body sticks
    modes, slip_changes : as those of Motion
    """

    states: np.ndarray
    is_stuck: np.ndarray
    modes: Changes
    slip_changes: Changes


@cache
def compute_reference_motion(scene: Scene) -> ReferenceMotion:
    """Return the reference of a scene."""
    times = np.linspace(0.0, scene.stop, FINE * (len(scene.times) - 1) + 1)
    fine = Motion(times, *SOLUTIONS[scene.name](scene, times))
    assert fine.modes is not None
    states = fine.states[::FINE]
    is_stuck = np.abs(states[:, 1] - states[:, 2]) < ROUNDING
    return ReferenceMotion(states, is_stuck, fine.modes, fine.slip_changes(scene.level))


States = tuple[np.ndarray, int, Changes]  # states, steps (0, not of interest) and changes of mode


def solve_model(name: str, values: dict[str, float]) -> Callable[[Scene, np.ndarray], States]:
    """Return the solution of a model that has a module in harness.references.models."""

    def solve(scene: Scene, times: np.ndarray) -> States:
        grid = CommunicationGrid(0.0, scene.stop, len(times) - 1)
        motion = compute_reference(name, [(0.0, scene.stop, values)], grid)
        events = [(t, mode) for t, mode in motion.events or [] if t <= scene.stop]
        return np.column_stack([motion.states, np.zeros(len(times))]), 0, events

    return solve


def solve_held(scene: Scene, times: np.ndarray) -> States:
    """Return the state at rest."""
    return np.zeros((len(times), 3)), 0, []


def solve_belt(scene: Scene, times: np.ndarray) -> States:
    """Return the motion of the block on the belt, which is solved in the frame of the belt."""
    solution, speed = peer_solvers.solve("scipy", "DOP853", BELT, times, RTOL, ATOL), scene.start[2]
    y, v = solution.states.T
    return np.column_stack([y + speed * times, v + speed, np.full(len(y), speed)]), 0, solution.events or []


def solve_clutch(scene: Scene, times: np.ndarray) -> States:
    """Return the motion of the clutch, whose angle is not compared."""
    states, events = event_located.solve(event_located.Clutch(), times.tolist(), "DOP853", RTOL, ATOL)
    return np.column_stack([np.zeros(len(times)), states[:, :2]]), 0, [(t, mode) for t, (mode,) in events]


PENDULUM_VALUES = {name: getattr(PENDULUM, name) for name in ("m", "a", "g", "r", "mu")} | {
    "J_G": PENDULUM.inertia - PENDULUM.m * PENDULUM.a**2,
    "theta0": PENDULUM.start[0],
    "omega0": PENDULUM.start[1],
    "pin_load": 1.0,
    "T_ext": 0.0,
}
SOLUTIONS = {
    "rest": solve_model("coulomb", REST.fmu_values("m", "k", "f")),
    "sled": solve_model("stickslip", SLED.fmu_values("m", "k", "g", "mu_s", "mu_d", "v_driver")),
    "held": solve_held,
    "belt": solve_belt,
    "clutch": solve_clutch,
    "pendulum": solve_model("pendulum", PENDULUM_VALUES),
}
