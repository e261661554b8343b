"""Reference motions of the scenes: closed forms, and solutions whose events are located; none comes from an FMU."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from benchmarks.references import event_located
from harness.references import peer_solvers
from harness.references.reference_trajectory import CommunicationGrid, compute_reference
from harness.simulation.solution import Solution

from .scenes import BELT, PENDULUM, REST, SLED, Scene

RTOL, ATOL = event_located.TOLERANCES["DOP853"]
FINE = 20  # points per compared interval, to find when the slip passes a level


@cache
def compute_reference_motion(scene: Scene) -> Solution:
    """Return the reference of a scene, at `FINE` times as many points."""
    times = np.linspace(0.0, scene.stop, FINE * (len(scene.times) - 1) + 1)
    return SOLUTIONS[scene.name](scene, times)


def solve_model(name: str, values: dict[str, float]) -> Callable[[Scene, np.ndarray], Solution]:
    """Return the solution of a model that has a module in harness.references.models."""

    def solve(scene: Scene, times: np.ndarray) -> Solution:
        grid = CommunicationGrid(0.0, scene.stop, len(times) - 1)
        motion = compute_reference(name, [(0.0, scene.stop, values)], grid)
        events = [(t, mode) for t, mode in motion.events or [] if t <= scene.stop]
        return Solution(times, np.column_stack([motion.states, np.zeros(len(times))]), events)

    return solve


def solve_held(scene: Scene, times: np.ndarray) -> Solution:
    """Return the state at rest."""
    return Solution(times, np.zeros((len(times), 3)), [])


def solve_belt(scene: Scene, times: np.ndarray) -> Solution:
    """Return the motion of the block on the belt, which is solved in the frame of the belt."""
    solution, speed = peer_solvers.solve("scipy", "DOP853", BELT, times, RTOL, ATOL), scene.start[2]
    y, v = solution.states.T
    return replace(solution, states=np.column_stack([y + speed * times, v + speed, np.full(len(y), speed)]))


def solve_clutch(scene: Scene, times: np.ndarray) -> Solution:
    """Return the motion of the clutch, whose angle is not compared."""
    states, events = event_located.solve(event_located.Clutch(), times.tolist(), "DOP853", RTOL, ATOL)
    angles = np.zeros(len(times))
    return Solution(times, np.column_stack([angles, states[:, :2]]), [(t, mode) for t, (mode,) in events])


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
